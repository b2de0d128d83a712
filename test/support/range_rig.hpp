#pragma once

#include <Eigen/Dense>
#include <cmath>
#include <map>
#include <utility>
#include <vector>

#include "satellite_sky.hpp"
#include "urban_gnss_localization/gnss/range_fix.hpp"

namespace urban_gnss {

inline constexpr double kNominalCn0 = 45.0;  // dB-Hz, of a signal in line of sight at 37 degrees

/// A signal as strong as those in line of sight are, or weaker.
inline void set_cn0(SatelliteObservation& s, double weaker_db = 0.0, const RangeFixParameters& p = {}) {
  s.cn0_dbhz = kNominalCn0 + p.nlos.cn0_rise * (std::sin(s.look.elevation_rad) - 0.6) - weaker_db;
}

/// The partial derivatives of a residual by the antenna's place (east, north, up): by the look angles, as in textbooks.
inline Eigen::Vector3d range_gradient(const LookAngles& look) {
  return -Eigen::Vector3d(std::sin(look.azimuth_rad) * std::cos(look.elevation_rad),
                          std::cos(look.azimuth_rad) * std::cos(look.elevation_rad), std::sin(look.elevation_rad));
}

/// Free signals whose residuals say that the antenna is at `place` (m, from the fix); each constellation has a clock.
inline Sky with_ranges(Sky sky, const Eigen::Vector3d& place, const std::map<Constellation, double>& clocks_m = {}) {
  for (SatelliteObservation& s : sky) {
    set_cn0(s);
    const auto clock = clocks_m.find(s.id.constellation);
    s.residual_m = range_gradient(s.look).dot(place) + (clock == clocks_m.end() ? 0.0 : clock->second);
  }
  return sky;
}

inline Sky two_constellations() {
  Sky sky = open_sky();
  for (const auto& [azimuth, elevation] : {std::pair{30, 35}, {120, 65}, {200, 22}, {255, 33}, {330, 55}}) {
    sky.push_back(satellite(azimuth, azimuth, elevation, Constellation::kGalileo));
  }
  return sky;
}

/// Every range is taken for direct, whatever its residual.
inline RangeFixParameters all_direct() {
  RangeFixParameters p;
  p.nlos.mean = 1000.0;
  p.nlos.sigma = 20.0;
  p.nlos.elevation_exponent = 0.0;
  return p;
}

/// How far from zero mean, and how certain, each range is said to be.
struct RangeNoise {
  double mean_m;
  double sigma_m;
};

/// Least squares with all unknowns at once: east, north, up and a clock each for GPS and the others.
struct DenseRanges {
  Eigen::MatrixXd h;
  Eigen::VectorXd residuals;

  explicit DenseRanges(const Sky& sky) {
    std::map<Constellation, Eigen::Index> clocks;
    for (const auto& s : sky) clocks.emplace(s.id.constellation, 3 + static_cast<Eigen::Index>(clocks.size()));
    h = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(sky.size()), 3 + static_cast<Eigen::Index>(clocks.size()));
    residuals.resize(h.rows());
    for (Eigen::Index i = 0; i < h.rows(); ++i) {
      const auto& s = sky[static_cast<std::size_t>(i)];
      h.row(i).head<3>() = range_gradient(s.look);
      h(i, clocks.at(s.id.constellation)) = 1.0;
      residuals[i] = s.residual_m;
    }
  }

  struct Solution {
    Eigen::VectorXd unknowns;
    Eigen::MatrixXd normal;
    double cost;  ///< squares of what remains, in sigmas
    RelativePlace place() const { return {unknowns.head<2>(), normal.inverse().topLeftCorner<2, 2>()}; }
  };

  /// With a belief about the height, and one about the place.
  Solution solve(const std::vector<RangeNoise>& noise, double height_sigma_m, const RelativePlace& prior) const {
    Eigen::VectorXd weight(h.rows());
    Eigen::VectorXd target(h.rows());
    for (Eigen::Index i = 0; i < h.rows(); ++i) {
      weight[i] = 1.0 / std::pow(noise[static_cast<std::size_t>(i)].sigma_m, 2);
      target[i] = residuals[i] - noise[static_cast<std::size_t>(i)].mean_m;
    }
    Solution result;
    result.normal = h.transpose() * weight.asDiagonal() * h;
    Eigen::VectorXd right = h.transpose() * weight.asDiagonal() * target;
    result.normal(2, 2) += 1.0 / (height_sigma_m * height_sigma_m);
    const Eigen::Matrix2d information = prior.covariance.inverse();
    result.normal.topLeftCorner<2, 2>() += information;
    right.head<2>() += information * prior.offset;
    result.unknowns = result.normal.fullPivLu().solve(right);
    const Eigen::VectorXd left = target - h * result.unknowns;
    const Eigen::Vector2d moved = result.unknowns.head<2>() - prior.offset;
    result.cost = left.cwiseAbs2().dot(weight) + std::pow(result.unknowns[2] / height_sigma_m, 2) +
                  moved.dot(information * moved);
    return result;
  }
};

/// What a receiver reports: the residuals at its own solution, by least squares with these weights, of ranges whose
/// residuals at the true place are those of `sky`. Also where that solution is (m, east and north of the true place).
template <class Weight>
std::pair<Sky, Eigen::Vector2d> at_solution(Sky sky, const Weight& weight) {
  const DenseRanges ranges(sky);
  Eigen::VectorXd weights(ranges.h.rows());
  for (Eigen::Index i = 0; i < weights.size(); ++i) weights[i] = weight(sky[static_cast<std::size_t>(i)]);
  const Eigen::MatrixXd weighted = weights.asDiagonal() * ranges.h;
  const Eigen::VectorXd solution =
      (ranges.h.transpose() * weighted).ldlt().solve(weighted.transpose() * ranges.residuals);
  const Eigen::VectorXd left = ranges.residuals - ranges.h * solution;
  for (Eigen::Index i = 0; i < left.size(); ++i) sky[static_cast<std::size_t>(i)].residual_m = left[i];
  return {sky, solution.head<2>()};
}

inline Sky at_solution(const Sky& sky) {
  return at_solution(sky, [](const SatelliteObservation&) { return 1.0; }).first;
}

/// What range_fix() believes where ranges say nothing.
inline RelativePlace anywhere() { return {Eigen::Vector2d::Zero(), isotropic(100.0)}; }

inline RelativePlace known_place(const Eigen::Vector2d& offset, double sigma_m) { return {offset, isotropic(sigma_m)}; }

}  // namespace urban_gnss
