#include "urban_gnss_localization/gnss/range_fix.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>

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
constexpr int kHeight = 2;

struct SatelliteRange {
  Eigen::Vector3d line_of_sight;
  std::size_t clock;
  double residual_m;
  double nlos_before;      ///< probability of NLOS by C/N0
  double log_odds_before;  ///< of the same
  NlosRange nlos;          ///< excess, if it is

  double nlos_variance_m2() const { return nlos.sigma_m * nlos.sigma_m; }
};

std::vector<SatelliteRange> ranges_of(const std::vector<SatelliteObservation>& satellites, double nominal_cn0_dbhz,
                                      const RangeFixParameters& p) {
  std::vector<const SatelliteObservation*> usable;
  usable.reserve(satellites.size());
  for (const SatelliteObservation& each : satellites) {
    if (is_received(each) && std::abs(each.residual_m) <= kMaxResidual_m) usable.push_back(&each);
  }
  // One signal of each satellite, the first.
  std::sort(usable.begin(), usable.end(), [](const SatelliteObservation* a, const SatelliteObservation* b) {
    return a->id != b->id ? a->id < b->id : a < b;
  });
  usable.erase(std::unique(usable.begin(), usable.end(),
                           [](const SatelliteObservation* a, const SatelliteObservation* b) { return a->id == b->id; }),
               usable.end());
  std::array<int, kMostClocks> sharing{};
  for (const SatelliteObservation* each : usable) ++sharing[clock_number(each->id.constellation)];
  std::vector<SatelliteRange> ranges;
  ranges.reserve(usable.size());
  for (const SatelliteObservation* observation : usable) {
    const SatelliteObservation& each = *observation;
    const std::size_t clock = clock_number(each.id.constellation);
    if (sharing[clock] < 2) continue;  // alone, it only tells its clock
    const double weaker_db = nominal_cn0_dbhz - levelled_cn0_dbhz(each, p.nlos);
    const double by_cn0 = probability_of(nlos_log_odds(weaker_db - p.nlos_cn0_drop, p.nlos));
    const double nlos = std::clamp(by_cn0, 1.0 - kMostCertain, kMostCertain);
    ranges.push_back({line_of_sight(each.look), clock, each.residual_m, nlos, log_odds(nlos),
                      nlos_range(each.look.elevation_rad, p.nlos)});
  }
  return ranges;
}

/// Least squares for the antenna's place, its height and the clocks, of ranges that are each NLOS with a
/// probability. A clock is the mean of its ranges, by which it is eliminated: what is left are three unknowns.
class RangeSystem {
 public:
  RangeSystem(const std::vector<SatelliteRange>& ranges, const RangeFixParameters& parameters)
      : ranges_(ranges),
        direct_variance_m2_(parameters.range_sigma * parameters.range_sigma),
        height_information_(1.0 / (parameters.range_height_sigma * parameters.range_height_sigma)) {
    nlos_probability_.reserve(ranges.size());
    for (const SatelliteRange& range : ranges) nlos_probability_.push_back(range.nlos_before);
    weighed_.resize(ranges.size());
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
    Eigen::Matrix3d normal = normal_;
    Eigen::Vector3d right = right_;
    normal.topLeftCorner<kPlane, kPlane>() += information;
    right.head<kPlane>() += information * known.offset;
    const Eigen::LDLT<Eigen::Matrix3d> factors(normal);
    const Eigen::Vector3d place = factors.solve(right);
    const Eigen::Matrix3d covariance = factors.solve(Eigen::Matrix3d::Identity());
    for (std::size_t i = 0; i < ranges_.size(); ++i) {
      const SatelliteRange& range = ranges_[i];
      const ClockMeans::Mean& clock = clocks_.of(range.clock);
      const Eigen::Vector3d geometry = clock.line_of_sight - range.line_of_sight;
      const double error = range.residual_m - clock.residual_m - geometry.dot(place);
      const double variance = geometry.dot(covariance * geometry) + 1.0 / clock.weight;
      const double if_nlos = error - range.nlos.mean_m;
      const double nlos_variance = range.nlos_variance_m2() + variance;
      const double direct_variance = direct_variance_m2_ + variance;
      const double log_ratio = 0.5 * (error * error / direct_variance - if_nlos * if_nlos / nlos_variance -
                                      std::log(nlos_variance / direct_variance));
      nlos_probability_[i] = probability_of(range.log_odds_before + log_ratio);
    }
  }

  /// The place by the normal equations: height and clocks are whatever fits best.
  RelativePlace place() const {
    const Eigen::Vector2d by_height = normal_.block<kPlane, 1>(0, kHeight);
    const Eigen::Vector2d gain = by_height / normal_(kHeight, kHeight);
    Eigen::Matrix2d information = normal_.topLeftCorner<kPlane, kPlane>() - gain * by_height.transpose();
    information = 0.5 * (information + information.transpose()).eval();
    information.diagonal().array() += 1.0 / (kFarthest_m * kFarthest_m);
    RelativePlace result;
    result.covariance = information.inverse();
    result.offset = result.covariance * (right_.head<kPlane>() - gain * right_[kHeight]);
    return result;
  }

 private:
  struct WeighedRange {
    double residual_m{0.0};
    double weight{0.0};
  };
  template <class Weigh>
  void set_normal(const Weigh& weigh) {
    clocks_ = {};
    for (std::size_t i = 0; i < ranges_.size(); ++i) {
      const SatelliteRange& range = ranges_[i];
      weighed_[i] = weigh(range, nlos_probability_[i]);
      clocks_.add(range.clock, weighed_[i].weight, weighed_[i].residual_m, range.line_of_sight);
    }
    clocks_.finish();
    normal_.setZero();
    right_.setZero();
    normal_(kHeight, kHeight) = height_information_;
    for (std::size_t i = 0; i < ranges_.size(); ++i) {
      const ClockMeans::Mean& clock = clocks_.of(ranges_[i].clock);
      const Eigen::Vector3d geometry = clock.line_of_sight - ranges_[i].line_of_sight;
      const Eigen::Vector3d weighted = weighed_[i].weight * geometry;
      normal_ += weighted * geometry.transpose();
      right_ += weighted * (weighed_[i].residual_m - clock.residual_m);
    }
  }

  const std::vector<SatelliteRange>& ranges_;
  double direct_variance_m2_;
  double height_information_;
  std::vector<double> nlos_probability_;
  std::vector<WeighedRange> weighed_;
  ClockMeans clocks_;
  Eigen::Matrix3d normal_;
  Eigen::Vector3d right_;
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
