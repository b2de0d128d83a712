#pragma once

#include <Eigen/LU>
#include <cmath>
#include <optional>
#include <vector>

#include "matchers.hpp"
#include "urban_gnss_localization/geometry/angles.hpp"
#include "urban_gnss_localization/gnss/gnss_covariance.hpp"

namespace urban_gnss {

using Sky = std::vector<SatelliteObservation>;

inline SatelliteObservation satellite(int svid, double azimuth_deg, double elevation_deg,
                                      Constellation constellation = Constellation::kGps) {
  SatelliteObservation s;
  s.id = {constellation, svid};
  s.look = {degrees_to_radians(azimuth_deg), degrees_to_radians(elevation_deg)};
  return s;
}

/// Nine satellites all around, at whole degrees as receivers give them.
inline Sky open_sky(double cn0_dbhz = SatelliteObservation::kUnknown, double blocked = SatelliteObservation::kUnknown) {
  Sky sky{satellite(1, 10, 25),  satellite(2, 55, 60),  satellite(3, 100, 15),
          satellite(4, 150, 40), satellite(5, 190, 70), satellite(6, 235, 20),
          satellite(7, 270, 50), satellite(8, 310, 30), satellite(9, 350, 80)};
  for (auto& s : sky) {
    s.cn0_dbhz = cn0_dbhz;
    s.blocked_fraction = blocked;
    s.known_fraction = std::isnan(blocked) ? 0.0 : 1.0;
  }
  return sky;
}

inline Sky random_sky(RandomEngine& engine, int count) {
  const Constellation constellations[] = {Constellation::kGps, Constellation::kGalileo, Constellation::kGlonass};
  Sky sky;
  for (int i = 0; i < count; ++i) {
    auto s = satellite(i + 1, std::round(uniform_between(0, 360, engine)), std::round(uniform_between(5, 90, engine)),
                       constellations[engine() % 3]);
    s.cn0_dbhz = uniform_between(15, 50, engine);
    s.blocked_fraction = draw_uniform(engine);
    s.known_fraction = draw_uniform(engine);
    sky.push_back(s);
  }
  return sky;
}

inline GnssCovarianceParameters with_model(CovarianceModel model) {
  GnssCovarianceParameters p;
  p.model = model;
  return p;
}

inline constexpr CovarianceModel kModels[] = {CovarianceModel::kConventional, CovarianceModel::kPaper,
                                              CovarianceModel::kSoft};

inline GnssCovariance compute(const Sky& sky, const GnssCovarianceParameters& p,
                              const std::optional<Eigen::Matrix2d>& claimed = std::nullopt) {
  return gnss_covariance(sky, std::nullopt, claimed, p);
}

/// Algorithm 1 and eq. (4), as printed, for satellites of one constellation.
inline Eigen::Matrix2d equation_4(const Sky& sky, double sigma) {
  Eigen::MatrixXd h(static_cast<Eigen::Index>(sky.size()), 4);
  for (Eigen::Index i = 0; i < h.rows(); ++i) {
    const auto& look = sky[static_cast<std::size_t>(i)].look;
    h.row(i) << std::cos(look.elevation_rad) * std::sin(look.azimuth_rad),
        std::cos(look.elevation_rad) * std::cos(look.azimuth_rad), std::sin(look.elevation_rad), 1.0;
  }
  return sigma * sigma * (h.transpose() * h).inverse().topLeftCorner<2, 2>();
}

}  // namespace urban_gnss
