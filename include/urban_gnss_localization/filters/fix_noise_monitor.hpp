#pragma once

#include <Eigen/Core>
#include <optional>

#include "urban_gnss_localization/common/parameters.hpp"

namespace urban_gnss {

struct FixNoiseParameters {
  bool adapt_fix_noise{true};     ///< tell white from coloured errors as the fixes show; false: all of it is white
  double fix_noise_memory{60.0};  ///< count of fixes that the statistics are averaged over, at least 10

  template <class V>
  void visit(V& v) {
    v("adapt_fix_noise", adapt_fix_noise);
    v("fix_noise_memory", fix_noise_memory, at_least(10.0));
  }
  void check(std::vector<std::string>&) const {}
};

/// What the error of a fix is made of, as shares of its declared covariance.
struct FixNoise {
  double white{1.0};     ///< new with every fix
  double coloured{0.0};  ///< changes slowly
};

/// How much of a fix's error is new with every fix, from the fixes against short-horizon odometry: half the mean square
/// by which neighbours differ beyond what the robot moved, relative to their declared covariance. White errors of the
/// declared size give 1; what a smoothing receiver leaves is far below, and the rest of its error is there all the
/// same, only slow. It depends on no estimate of a filter's, so that it cannot talk itself into anything.
class FixNoiseMonitor {
 public:
  /// Requires parameters without faults.
  explicit FixNoiseMonitor(const FixNoiseParameters& parameters) : parameters_(parameters) {}

  /// Takes a fix: position (m) and declared covariance (m^2); the dead-reckoned place of the antenna (m, any origin,
  /// same axes) and its accumulated variance (m^2), of which the difference between two fixes counts; the share of the
  /// distance (1) that heading and scale may be wrong by; time (s), ascending. Nothing is learned from a doubted one.
  void add(const Eigen::Vector2d& position, const Eigen::Matrix2d& covariance, const Eigen::Vector2d& dead_reckoned,
           double dead_reckoned_variance_m2, double distance_share, double time_s, bool is_doubted = false);

  void reset();

  /// Both whole until there are enough fixes. White alone where it is not to adapt.
  FixNoise noise() const;

 private:
  struct Fix {
    Eigen::Vector2d residual;  ///< fix minus dead reckoning, m
    Eigen::Vector2d place;     ///< dead-reckoned, m
    Eigen::Matrix2d covariance;
    double variance_m2;
    double time_s;
  };

  FixNoiseParameters parameters_;
  std::optional<Fix> last_;
  double near_{1.0};  ///< mean of the neighbours' ratios
  double count_{0.0};
};

}  // namespace urban_gnss
