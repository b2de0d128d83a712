#include "urban_gnss_localization/gnss/range_fix.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <map>

#include "urban_gnss_localization/common/positive_definite.hpp"
#include "urban_gnss_localization/gnss/range_geometry.hpp"

namespace urban_gnss {
namespace {

constexpr double kMostCertain = 0.98;
constexpr double kFarthest_m = 100.0;
constexpr double kLeastSigma_m = 1e-3;
constexpr double kMaxResidual_m = 1e5;  ///< beyond it, a driver's invention
constexpr int kRounds = 4;
constexpr int kPlane = 2;

struct SatelliteRange {
  RangeDirection direction;
  double residual_m;
  double nlos_before;  ///< probability of NLOS by C/N0
  NlosRange nlos;      ///< excess, if it is

  double nlos_variance_m2() const { return nlos.sigma_m * nlos.sigma_m; }
};

std::vector<SatelliteRange> ranges_of(const std::vector<SatelliteObservation>& satellites, double nominal_cn0_dbhz,
                                      const RangeFixParameters& p) {
  std::map<SatelliteId, const SatelliteObservation*> usable;  // one signal of each satellite
  std::map<Constellation, int> sharing;
  for (const SatelliteObservation& each : satellites) {
    if (!is_received(each) || !(std::abs(each.residual_m) <= kMaxResidual_m)) continue;
    if (usable.emplace(each.id, &each).second) ++sharing[clock_of(each.id.constellation)];
  }
  std::vector<SatelliteRange> ranges;
  for (const auto& [id, observation] : usable) {
    const SatelliteObservation& each = *observation;
    const Constellation clock = clock_of(id.constellation);
    if (sharing[clock] < 2) continue;  // alone, it only tells its clock
    const double weaker_db = nominal_cn0_dbhz - levelled_cn0_dbhz(each, p.nlos);
    const double nlos = probability_of(nlos_log_odds(weaker_db - p.nlos_cn0_drop, p.nlos));
    ranges.push_back({{clock, line_of_sight(each.look)},
                      each.residual_m,
                      std::clamp(nlos, 1.0 - kMostCertain, kMostCertain),
                      nlos_range(each.look.elevation_rad, p.nlos)});
  }
  return ranges;
}

double log_gaussian(double error, double variance) {
  return -0.5 * error * error / variance - 0.5 * std::log(variance);
}

/// Least squares for the antenna's place, its height and the clocks, of ranges that are each NLOS with a
/// probability.
class RangeSystem {
 public:
  RangeSystem(const std::vector<SatelliteRange>& ranges, const RangeFixParameters& parameters)
      : ranges_(ranges),
        direct_variance_m2_(parameters.range_sigma * parameters.range_sigma),
        height_information_(1.0 / (parameters.range_height_sigma * parameters.range_height_sigma)) {
    std::vector<RangeDirection> directions;
    for (const SatelliteRange& range : ranges) directions.push_back(range.direction);
    h_ = range_geometry(directions);
    nlos_probability_.resize(h_.rows());
    for (Eigen::Index i = 0; i < h_.rows(); ++i) {
      nlos_probability_[i] = ranges[static_cast<std::size_t>(i)].nlos_before;
    }
  }

  /// Maximization: the normal equations, where every range counts as both kinds by its probability.
  void weigh() {
    set_normal([&](const SatelliteRange& range, double nlos) {
      const double by_nlos = nlos / range.nlos_variance_m2();
      const double weight = (1.0 - nlos) / direct_variance_m2_ + by_nlos;
      return WeighedRange{range.residual_m - by_nlos * range.nlos.mean_m / weight, weight};
    });
  }

  /// The same where every range counts as one Gaussian, with the mean and variance of both kinds together: where it is
  /// open which it is, it says little.
  void weigh_by_moments() {
    set_normal([&](const SatelliteRange& range, double nlos) {
      const double direct = 1.0 - nlos;
      const double variance = direct * direct_variance_m2_ + nlos * range.nlos_variance_m2() +
                              direct * nlos * range.nlos.mean_m * range.nlos.mean_m;
      return WeighedRange{range.residual_m - nlos * range.nlos.mean_m, 1.0 / variance};
    });
  }

  /// Expectation: which ranges are NLOS, given the solution of the normal equations and what is known.
  void judge(const RelativePlace& known) {
    const Eigen::Matrix2d information = known.covariance.inverse();
    Eigen::MatrixXd normal = normal_;
    Eigen::VectorXd right = right_;
    normal.topLeftCorner<kPlane, kPlane>() += information;
    right.head<kPlane>() += information * known.offset;
    const Eigen::LDLT<Eigen::MatrixXd> factors(normal);
    const Eigen::VectorXd solution = factors.solve(right);
    const Eigen::MatrixXd covariance = factors.solve(Eigen::MatrixXd::Identity(h_.cols(), h_.cols()));
    for (Eigen::Index i = 0; i < h_.rows(); ++i) {
      const SatelliteRange& range = ranges_[static_cast<std::size_t>(i)];
      const double error = range.residual_m - h_.row(i).dot(solution);
      const double variance = h_.row(i) * covariance * h_.row(i).transpose();
      nlos_probability_[i] = probability_of(
          log_odds(range.nlos_before) + log_gaussian(error - range.nlos.mean_m, range.nlos_variance_m2() + variance) -
          log_gaussian(error, direct_variance_m2_ + variance));
    }
  }

  /// The place by the normal equations: height and clocks are whatever fits best.
  RelativePlace place() const {
    const Eigen::Index others = h_.cols() - kPlane;
    const Eigen::MatrixXd gain =
        normal_.bottomRightCorner(others, others).ldlt().solve(normal_.bottomLeftCorner(others, kPlane)).transpose();
    Eigen::Matrix2d information =
        normal_.topLeftCorner<kPlane, kPlane>() - gain * normal_.bottomLeftCorner(others, kPlane);
    information = 0.5 * (information + information.transpose()).eval();
    information.diagonal().array() += 1.0 / (kFarthest_m * kFarthest_m);
    RelativePlace result;
    result.covariance = information.inverse();
    result.offset = result.covariance * (right_.head<kPlane>() - gain * right_.tail(others));
    return result;
  }

 private:
  struct WeighedRange {
    double residual_m;
    double weight;
  };

  template <class Weigh>
  void set_normal(const Weigh& weigh) {
    Eigen::VectorXd weight(h_.rows());
    Eigen::VectorXd target(h_.rows());
    for (Eigen::Index i = 0; i < h_.rows(); ++i) {
      const WeighedRange weighed = weigh(ranges_[static_cast<std::size_t>(i)], nlos_probability_[i]);
      weight[i] = weighed.weight;
      target[i] = weighed.residual_m;
    }
    const Eigen::MatrixXd weighted = weight.asDiagonal() * h_;
    normal_ = h_.transpose() * weighted;
    normal_(kHeightColumn, kHeightColumn) += height_information_;
    right_ = weighted.transpose() * target;
  }

  const std::vector<SatelliteRange>& ranges_;
  double direct_variance_m2_;
  double height_information_;
  Eigen::MatrixXd h_;
  Eigen::VectorXd nlos_probability_;  ///< probabilities
  Eigen::MatrixXd normal_;
  Eigen::VectorXd right_;
};

}  // namespace

std::optional<RelativePlace> range_fix(const std::vector<SatelliteObservation>& satellites, double nominal_cn0_dbhz,
                                       const RelativePlace& known, const RangeFixParameters& parameters) {
  const std::vector<SatelliteRange> ranges = ranges_of(satellites, nominal_cn0_dbhz, parameters);
  if (ranges.empty()) return std::nullopt;
  RelativePlace certain = known;  // never wholly, so that it can be inverted
  certain.covariance.diagonal().array() += kLeastSigma_m * kLeastSigma_m;
  RangeSystem system(ranges, parameters);
  for (int round = 0; round < kRounds; ++round) {
    system.weigh();
    system.judge(certain);
  }
  system.weigh_by_moments();
  const RelativePlace place = system.place();
  // Ranges of micrometres leave nothing but rounding errors of a direction of which they say nothing.
  if (!place.offset.allFinite() || !is_positive_definite(place.covariance)) return std::nullopt;
  return place;
}

}  // namespace urban_gnss
