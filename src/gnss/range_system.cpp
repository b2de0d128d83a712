#include "range_system.hpp"

#include <Eigen/Dense>

namespace urban_gnss {
namespace {

constexpr double kFarthest_m = 100.0;
constexpr double kMaxLogOdds = 30.0;
constexpr int kRounds = 4;
constexpr int kPlane = 2;
constexpr int kHeight = 2;

URBAN_GNSS_INLINE Quad probabilities_of(const Quad& log_odds) {
  return 1.0 / (1.0 + quad_exp(-quad_max(quad_min(log_odds, quad(kMaxLogOdds)), quad(-kMaxLogOdds))));
}

/// The mean of a clock's ranges.
struct ClockMean {
  double weight{0.0};  ///< the sum
  double residual_m{0.0};
  double line_of_sight[3]{};
};

class RangeSystem {
 public:
  URBAN_GNSS_INLINE RangeSystem(ClockedRanges& ranges, const RangeFixParameters& parameters)
      : ranges_(ranges),
        direct_variance_m2_(parameters.range_sigma * parameters.range_sigma),
        height_information_(1.0 / (parameters.range_height_sigma * parameters.range_height_sigma)) {
    for (RangeQuad& each : ranges_.quads) each.nlos_probability = probabilities_of(each.log_odds_before);
  }

  /// Maximization: the normal equations, where every range counts as both kinds by its probability.
  URBAN_GNSS_INLINE void weigh() {
    for (RangeQuad& each : ranges_.quads) {
      const Quad by_nlos = each.nlos_probability / each.nlos_variance_m2;
      const Quad weight = (1.0 - each.nlos_probability) / direct_variance_m2_ + by_nlos;
      each.corrected_m = each.residual_m - by_nlos * each.nlos_mean_m / weight;
      each.weight = each.is_range * weight;
    }
    set_normal();
  }

  /// The same where every range counts as one Gaussian, with the mean and variance of both kinds together: where it is
  /// open which it is, it says little.
  URBAN_GNSS_INLINE void weigh_by_moments() {
    for (RangeQuad& each : ranges_.quads) {
      const Quad nlos = each.nlos_probability;
      const Quad direct = 1.0 - nlos;
      const Quad variance = direct * direct_variance_m2_ + nlos * each.nlos_variance_m2 +
                            direct * nlos * each.nlos_mean_m * each.nlos_mean_m;
      each.corrected_m = each.residual_m - nlos * each.nlos_mean_m;
      each.weight = each.is_range / variance;
    }
    set_normal();
  }

  /// Expectation: which ranges are NLOS, given the solution of the normal equations and what is known.
  URBAN_GNSS_INLINE void judge(const RelativePlace& known) {
    const Eigen::Matrix2d information = known.covariance.inverse();
    Eigen::Matrix3d normal = normal_;
    Eigen::Vector3d right = right_;
    normal.topLeftCorner<kPlane, kPlane>() += information;
    right.head<kPlane>() += information * known.offset;
    const Eigen::LDLT<Eigen::Matrix3d> factors(normal);
    const Eigen::Vector3d place = factors.solve(right);
    const Eigen::Matrix3d covariance = factors.solve(Eigen::Matrix3d::Identity());
    for_each_range([&](RangeQuad& each, const ClockMean& clock) URBAN_GNSS_INLINE_LAMBDA {
      Quad geometry[3];
      for (int k = 0; k < 3; ++k) geometry[k] = clock.line_of_sight[k] - each.line_of_sight[k];
      Quad error = each.residual_m - clock.residual_m;
      Quad variance = quad(1.0 / clock.weight);
      for (int k = 0; k < 3; ++k) {
        error -= geometry[k] * place[k];
        variance += geometry[k] *
                    (covariance(k, 0) * geometry[0] + covariance(k, 1) * geometry[1] + covariance(k, 2) * geometry[2]);
      }
      const Quad if_nlos = error - each.nlos_mean_m;
      const Quad nlos_variance = each.nlos_variance_m2 + variance;
      const Quad direct_variance = direct_variance_m2_ + variance;
      const Quad log_ratio = 0.5 * (error * error / direct_variance - if_nlos * if_nlos / nlos_variance -
                                    quad_log(nlos_variance / direct_variance));
      each.nlos_probability = probabilities_of(each.log_odds_before + log_ratio);
    });
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
  template <class F>
  URBAN_GNSS_INLINE void for_each_range(const F& f) {
    for (std::size_t clock = 0; clock < kMostClocks; ++clock) {
      for (std::size_t i = ranges_.first[clock]; i < ranges_.first[clock + 1]; ++i) {
        f(ranges_.quads[i], clocks_[clock]);
      }
    }
  }

  URBAN_GNSS_INLINE void set_normal() {
    for (std::size_t clock = 0; clock < kMostClocks; ++clock) {
      Quad sums[5]{};
      for (std::size_t i = ranges_.first[clock]; i < ranges_.first[clock + 1]; ++i) {
        const RangeQuad& each = ranges_.quads[i];
        sums[0] += each.weight;
        sums[1] += each.weight * each.corrected_m;
        for (int k = 0; k < 3; ++k) sums[2 + k] += each.weight * each.line_of_sight[k];
      }
      ClockMean& mean = clocks_[clock];
      mean.weight = sum_of(sums[0]);
      if (!(mean.weight > 0.0)) continue;
      mean.residual_m = sum_of(sums[1]) / mean.weight;
      for (int k = 0; k < 3; ++k) mean.line_of_sight[k] = sum_of(sums[2 + k]) / mean.weight;
    }
    Quad normal[3][3]{};
    Quad right[3]{};
    for_each_range([&](const RangeQuad& each, const ClockMean& clock) URBAN_GNSS_INLINE_LAMBDA {
      Quad geometry[3];
      for (int k = 0; k < 3; ++k) geometry[k] = clock.line_of_sight[k] - each.line_of_sight[k];
      const Quad apart = each.corrected_m - clock.residual_m;
      for (int k = 0; k < 3; ++k) {
        const Quad weighted = each.weight * geometry[k];
        right[k] += weighted * apart;
        for (int l = 0; l <= k; ++l) normal[k][l] += weighted * geometry[l];
      }
    });
    for (int k = 0; k < 3; ++k) {
      right_[k] = sum_of(right[k]);
      for (int l = 0; l <= k; ++l) normal_(k, l) = normal_(l, k) = sum_of(normal[k][l]);
    }
    normal_(kHeight, kHeight) += height_information_;
  }

  ClockedRanges& ranges_;
  double direct_variance_m2_;
  double height_information_;
  std::array<ClockMean, kMostClocks> clocks_;
  Eigen::Matrix3d normal_;
  Eigen::Vector3d right_;
};

}  // namespace

URBAN_GNSS_VECTORISED RelativePlace solve_ranges(ClockedRanges& ranges, const RelativePlace& known,
                                                 const RangeFixParameters& parameters) {
  RangeSystem system(ranges, parameters);
  for (int round = 0; round < kRounds; ++round) {
    system.weigh();
    system.judge(known);
  }
  system.weigh_by_moments();
  return system.place();
}

}  // namespace urban_gnss
