#include "urban_gnss_localization/gnss/gnss_covariance.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <set>

#include "urban_gnss_localization/common/positive_definite.hpp"
#include "urban_gnss_localization/geometry/angles.hpp"
#include "urban_gnss_localization/gnss/dilution_of_precision.hpp"

namespace urban_gnss {
namespace {

constexpr double kMaxCn0_dbhz = 70.0;  // beyond it, an invention of a driver

/// Shares of blocked, free and unknown rays; they sum to 1.
struct RayShares {
  double blocked;
  double free;
  double unknown;
};

RayShares ray_shares(double blocked_fraction, double known_fraction) {
  if (!std::isfinite(blocked_fraction)) return {0.0, 0.0, 1.0};
  const double blocked = std::clamp(blocked_fraction, 0.0, 1.0);
  // A ray that is known to be blocked is known.
  const double known = std::isfinite(known_fraction) ? std::clamp(known_fraction, blocked, 1.0) : blocked;
  return {blocked, known - blocked, 1.0 - known};
}

bool has_map(const SatelliteObservation& satellite) {
  return ray_shares(satellite.blocked_fraction, satellite.known_fraction).unknown < 1.0;
}

double nlos_by_map(const RayShares& rays, const GnssCovarianceParameters& parameters) {
  return rays.blocked * parameters.nlos_if_blocked + rays.free * parameters.nlos_if_free +
         rays.unknown * parameters.nlos_if_unknown;
}

double nlos_probability(const SatelliteObservation& satellite, const GnssCovarianceParameters& parameters) {
  const double by_map = nlos_by_map(ray_shares(satellite.blocked_fraction, satellite.known_fraction), parameters);
  if (!has_cn0(satellite)) return by_map;
  const double even_dbhz = parameters.nlos_cn0 + cn0_gain_db(satellite.look.elevation_rad, parameters.nlos);
  const double by_signal = nlos_log_odds(even_dbhz - std::min(satellite.cn0_dbhz, kMaxCn0_dbhz), parameters.nlos);
  return probability_of(by_signal + log_odds(by_map) - log_odds(parameters.nlos_if_unknown));
}

double receiver_weight(const SatelliteObservation& satellite, const GnssCovarianceParameters& parameters) {
  if (parameters.receiver_weighting == ReceiverWeighting::kEqual || !has_cn0(satellite)) return 1.0;
  const double weight = std::pow(10.0, 0.1 * (satellite.cn0_dbhz - parameters.weight_cn0));
  return std::clamp(weight, parameters.weight_floor, 1.0);
}

/// Error of a range.
struct RangeError {
  double mean_m;
  double variance_m2;
};

/// Of one from this elevation that is NLOS with probability p, where this share of the satellites is hidden.
RangeError range_error(double p, double elevation_rad, double hidden_share,
                       const GnssCovarianceParameters& parameters) {
  const NlosRange nlos =
      nlos_range(elevation_rad, parameters.nlos, std::pow(hidden_share, parameters.nlos_hidden_exponent));
  const double sigma_m = std::max(nlos.sigma_m, parameters.sigma_ure);
  const double direct_m2 = parameters.sigma_ure * parameters.sigma_ure;
  return {p * nlos.mean_m, (1.0 - p) * direct_m2 + p * sigma_m * sigma_m + p * (1.0 - p) * nlos.mean_m * nlos.mean_m};
}

Eigen::Matrix2d symmetric(const Eigen::Matrix2d& matrix) { return 0.5 * (matrix + matrix.transpose()); }

/// Eq. (4) or (6); nothing determined is R_inf.
Eigen::Matrix2d covariance_of(const std::optional<DilutionOfPrecision>& dop,
                              const GnssCovarianceParameters& parameters) {
  return dop ? symmetric(horizontal_covariance(*dop, parameters.sigma_ure)) : parameters.filter.infinite();
}

/// Receivers of two frequencies report a satellite twice; its direction counts once, with the better signal.
std::vector<std::size_t> used_satellites(const std::vector<SatelliteObservation>& satellites) {
  std::vector<std::size_t> used;
  std::map<SatelliteId, std::size_t> places;
  for (std::size_t i = 0; i < satellites.size(); ++i) {
    const SatelliteObservation& satellite = satellites[i];
    if (!satellite.tracked || !has_direction(satellite)) continue;
    const auto [place, is_new] = places.emplace(satellite.id, used.size());
    if (is_new || satellite.id.constellation == Constellation::kUnknown) {
      used.push_back(i);
    } else if (std::size_t& other = used[place->second];
               has_cn0(satellite) && !(satellites[other].cn0_dbhz >= satellite.cn0_dbhz)) {
      other = i;
    }
  }
  return used;
}

/// Of the satellites in the list, received or not, the share that probably has no line of sight.
double hidden_share(const std::vector<SatelliteObservation>& satellites,
                    const std::vector<double>& nlos_probabilities) {
  std::set<SatelliteId> in_view;
  for (const SatelliteObservation& satellite : satellites) {
    if (has_direction(satellite)) in_view.insert(satellite.id);
  }
  const double hidden = std::accumulate(nlos_probabilities.begin(), nlos_probabilities.end(), 0.0);
  const double seen = static_cast<double>(nlos_probabilities.size()) - hidden;
  return std::max(0.0, 1.0 - seen / static_cast<double>(std::max(in_view.size(), nlos_probabilities.size())));
}

std::vector<RangingSatellite> ranging(const std::vector<SatelliteObservation>& satellites,
                                      const std::vector<std::size_t>& which) {
  std::vector<RangingSatellite> result;
  result.reserve(which.size());
  for (const std::size_t i : which) {
    result.push_back(
        {line_of_sight(satellites[i].look), static_cast<int>(clock_of(satellites[i].id.constellation)), 1.0});
  }
  return result;
}

/// A fix's error, by which docs/methods/maier.md derives C.
struct SoftError {
  Eigen::Vector2d mean;
  Eigen::Matrix2d covariance;  ///< about the mean

  Eigen::Matrix2d second_moment() const { return covariance + mean * mean.transpose(); }
};

/// Nothing where the geometry does not determine the position.
std::optional<SoftError> soft_error(const std::vector<RangingSatellite>& satellites,
                                    const std::vector<RangeError>& errors) {
  if (!dilution_of_precision(satellites)) return std::nullopt;
  std::map<int, Eigen::Index> clocks;
  for (const RangingSatellite& satellite : satellites) {
    clocks.emplace(satellite.clock, 3 + static_cast<Eigen::Index>(clocks.size()));
  }
  const auto count = static_cast<Eigen::Index>(satellites.size());
  Eigen::MatrixXd h = Eigen::MatrixXd::Zero(count, 3 + static_cast<Eigen::Index>(clocks.size()));
  Eigen::VectorXd weight(count);
  Eigen::VectorXd mean(count);
  Eigen::VectorXd variance(count);
  for (Eigen::Index i = 0; i < count; ++i) {
    const auto k = static_cast<std::size_t>(i);
    h.row(i).head<3>() = satellites[k].line_of_sight;
    h(i, clocks.at(satellites[k].clock)) = 1.0;
    weight[i] = satellites[k].weight;
    mean[i] = errors[k].mean_m;
    variance[i] = errors[k].variance_m2;
  }
  const Eigen::MatrixXd weighted = weight.asDiagonal() * h;
  const Eigen::MatrixXd normal = h.transpose() * weighted;
  const Eigen::Matrix<double, 2, Eigen::Dynamic> gain = normal.ldlt().solve(weighted.transpose()).topRows<2>();
  return SoftError{gain * mean, symmetric(gain * variance.asDiagonal() * gain.transpose())};
}

/// The claim, where there is one; beyond 1000 km, that.
std::optional<Eigen::Matrix2d> usable_claim(const std::optional<Eigen::Matrix2d>& claimed) {
  if (!claimed || claimed->hasNaN()) return std::nullopt;
  constexpr double kLargest_m2 = 1e12;
  if (!(claimed->cwiseAbs().maxCoeff() < kLargest_m2)) return kLargest_m2 * Eigen::Matrix2d::Identity();
  const Eigen::Matrix2d claim = symmetric(*claimed);
  if (!is_positive_definite(claim)) return std::nullopt;
  return claim;
}

VisibilitySource source_of(bool map, bool signal) {
  if (map) return signal ? VisibilitySource::kLidarAndSatellites : VisibilitySource::kLidar;
  return signal ? VisibilitySource::kSatellites : VisibilitySource::kNone;
}

/// Without a usable satellite: the claim, enlarged by what the map shows of the sky.
void without_satellites(const std::optional<SkyObservation>& sky, const std::optional<Eigen::Matrix2d>& claim,
                        const GnssCovarianceParameters& parameters, GnssCovariance& result) {
  const double sigma = parameters.assumed_hdop * parameters.sigma_ure;
  const Eigen::Matrix2d assumed = 0.5 * sigma * sigma * Eigen::Matrix2d::Identity();
  result.conventional = result.model = claim.value_or(assumed);
  if (!sky) return;
  const RayShares rays = ray_shares(sky->blocked_fraction, sky->known_fraction);
  if (rays.unknown >= 1.0) return;
  result.source = VisibilitySource::kLidar;
  if (parameters.model == CovarianceModel::kConventional) return;
  const auto variance_m2 = [&](double p) {  // of a satellite in a sky of which the share p is hidden
    return range_error(p, kNlosReferenceElevation_rad, p, parameters).variance_m2;
  };
  const double added_m2 = variance_m2(nlos_by_map(rays, parameters)) - variance_m2(parameters.nlos_if_free);
  result.model *= 1.0 + std::max(added_m2, 0.0) / (parameters.sigma_ure * parameters.sigma_ure);
}

void with_satellites(const std::vector<SatelliteObservation>& satellites, const std::vector<std::size_t>& used,
                     const GnssCovarianceParameters& parameters, GnssCovariance& result) {
  const auto any = [&](bool (*has)(const SatelliteObservation&)) {
    return std::any_of(used.begin(), used.end(), [&](std::size_t i) { return has(satellites[i]); });
  };
  const bool by_signal = parameters.model == CovarianceModel::kSoft && any(has_cn0);
  result.source = source_of(any(has_map), by_signal);

  std::vector<std::size_t> visible;
  std::vector<double> probabilities;
  for (const std::size_t i : used) {
    SatelliteAssessment& assessment = result.satellites[i];
    assessment.is_used = true;
    if (result.source != VisibilitySource::kNone)
      assessment.nlos_probability = nlos_probability(satellites[i], parameters);
    assessment.is_visible = parameters.model == CovarianceModel::kSoft
                                ? assessment.nlos_probability < 0.5
                                : !(satellites[i].blocked_fraction >= parameters.blocked_threshold);
    if (assessment.is_visible) visible.push_back(i);
    probabilities.push_back(assessment.nlos_probability);
  }
  result.visible_count = static_cast<int>(visible.size());

  std::vector<RangingSatellite> all = ranging(satellites, used);
  const auto dop_all = dilution_of_precision(all);
  const auto dop_visible = dilution_of_precision(ranging(satellites, visible));
  if (dop_all) result.hdop_all = dop_all->hdop();
  if (dop_visible) result.hdop_visible = dop_visible->hdop();
  result.conventional = covariance_of(dop_all, parameters);
  switch (parameters.model) {
    case CovarianceModel::kConventional: result.model = result.conventional; break;
    case CovarianceModel::kPaper: result.model = covariance_of(dop_visible, parameters); break;
    case CovarianceModel::kSoft: {
      const double hidden = hidden_share(satellites, probabilities);
      std::vector<RangeError> errors;
      for (std::size_t k = 0; k < used.size(); ++k) {
        const SatelliteObservation& satellite = satellites[used[k]];
        all[k].weight = receiver_weight(satellite, parameters);
        errors.push_back(range_error(probabilities[k], satellite.look.elevation_rad, hidden, parameters));
      }
      const auto error = soft_error(all, errors);
      result.model = error ? error->second_moment() : parameters.filter.infinite();
      if (error) result.bias = error->mean;
      break;
    }
  }
}

/// `covariance` as it is passed on.
Eigen::Matrix2d bounded(const Eigen::Matrix2d& covariance, const std::optional<Eigen::Matrix2d>& claim,
                        const GnssCovarianceParameters& parameters) {
  const Eigen::Matrix2d usable = is_positive_definite(covariance) ? covariance : parameters.filter.infinite();
  if (!claim || parameters.allow_smaller) return usable;
  const Eigen::Matrix2d result = covariance_upper_bound(usable, *claim);
  return is_positive_definite(result) ? result : Eigen::Matrix2d(*claim + parameters.filter.infinite());
}

}  // namespace

EnumNames<CovarianceModel> enum_names(CovarianceModel) {
  return {{"conventional", CovarianceModel::kConventional},
          {"paper", CovarianceModel::kPaper},
          {"soft", CovarianceModel::kSoft}};
}

EnumNames<ReceiverWeighting> enum_names(ReceiverWeighting) {
  return {{"equal", ReceiverWeighting::kEqual}, {"cn0", ReceiverWeighting::kCn0}};
}

const char* to_string(VisibilitySource source) {
  switch (source) {
    case VisibilitySource::kNone: return "none";
    case VisibilitySource::kSatellites: return "satellites";
    case VisibilitySource::kLidar: return "lidar";
    case VisibilitySource::kLidarAndSatellites: return "lidar_and_satellites";
  }
  return "?";
}

void GnssCovarianceParameters::check(std::vector<std::string>& faults) const {
  if (!(nlos_if_free <= nlos_if_unknown && nlos_if_unknown <= nlos_if_blocked)) {
    faults.push_back("nlos_if_unknown = " + std::to_string(nlos_if_unknown) + ": must lie between nlos_if_free = " +
                     std::to_string(nlos_if_free) + " and nlos_if_blocked = " + std::to_string(nlos_if_blocked));
  }
}

Eigen::Matrix2d covariance_upper_bound(const Eigen::Matrix2d& matrix, const Eigen::Matrix2d& floor) {
  // In coordinates in which the floor is a unit circle, axes of the ellipse shorter than 1 are stretched to 1.
  const Eigen::Matrix2d root = Eigen::LLT<Eigen::Matrix2d>(floor).matrixL();
  const Eigen::Matrix2d half = root.triangularView<Eigen::Lower>().solve(matrix);
  const Eigen::Matrix2d whitened = root.triangularView<Eigen::Lower>().solve(half.transpose());
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> axes(symmetric(whitened));
  const Eigen::Matrix2d turned = root * axes.eigenvectors();
  const Eigen::Matrix2d result = turned * axes.eigenvalues().cwiseMax(1.0).asDiagonal() * turned.transpose();
  return symmetric(result);
}

GnssCovariance gnss_covariance(const std::vector<SatelliteObservation>& satellites,
                               const std::optional<SkyObservation>& sky, const std::optional<Eigen::Matrix2d>& claimed,
                               const GnssCovarianceParameters& parameters) {
  GnssCovariance result;
  result.satellites.resize(satellites.size());
  const auto claim = usable_claim(claimed);
  const std::vector<std::size_t> used = used_satellites(satellites);
  result.satellite_count = static_cast<int>(used.size());
  if (used.empty()) {
    without_satellites(sky, claim, parameters, result);
  } else {
    with_satellites(satellites, used, parameters, result);
  }
  result.weighted = bounded(result.model, claim, parameters);
  result.is_good = position_sigma(result.model) <= parameters.filter.sigma_threshold;
  return result;
}

GnssCovariance GnssCovarianceModel::process(Stamp stamp, const std::vector<SatelliteObservation>& satellites,
                                            const std::optional<SkyObservation>& sky,
                                            const std::optional<Eigen::Matrix2d>& claimed) {
  GnssCovariance result = gnss_covariance(satellites, sky, claimed, parameters_);
  switch (parameters_.model) {
    case CovarianceModel::kConventional: break;
    case CovarianceModel::kPaper: {
      const CovarianceFilter::Result filtered = filter_.add(result.model);
      result.weighted = bounded(filtered.covariance, usable_claim(claimed), parameters_);
      result.is_good = filtered.is_good;
      result.is_recovering = filtered.is_recovering;
      break;
    }
    case CovarianceModel::kSoft: {
      const bool is_determined = result.satellite_count == 0 || std::isfinite(result.hdop_all);
      if (!is_determined) break;
      const bool is_good_alone = result.is_good;
      const Eigen::Matrix2d smoothed =
          smoothing_.add(stamp, result.bias, result.model - result.bias * result.bias.transpose());
      result.weighted = bounded(smoothed, usable_claim(claimed), parameters_);
      result.is_good = position_sigma(smoothed) <= parameters_.filter.sigma_threshold;
      result.is_recovering = is_good_alone && !result.is_good;
      break;
    }
  }
  return result;
}

void GnssCovarianceModel::reset() {
  filter_.reset();
  smoothing_.reset();
}

}  // namespace urban_gnss
