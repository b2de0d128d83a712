#pragma once

#include <Eigen/Core>
#include <deque>

#include "urban_gnss_localization/common/parameters.hpp"

namespace urban_gnss {

struct FixNoiseParameters {
  bool adapt_fix_noise{true};
  double fix_noise_horizon{20.0};
  double fix_noise_memory{60.0};
  double fix_noise_max_inflation{20.0};

  void visit(ParameterVisitor& v) {
    v("adapt_fix_noise", adapt_fix_noise,
      "whether the declared covariance is enlarged where errors are correlated or larger");
    v("fix_noise_horizon", fix_noise_horizon, positive(), "s",
      "time between two fixes from which on their errors are taken to be independent");
    v("fix_noise_memory", fix_noise_memory, at_least(1.0), "", "number of fixes over which the noise is averaged");
    v("fix_noise_max_inflation", fix_noise_max_inflation, at_least(1.0), "",
      "greatest factor on a declared covariance (a variance)");
  }
};

/// The effective noise of a fix with a coloured error, from a variogram of the fixes against short-horizon odometry:
/// half the mean square by which two fixes differ beyond what the robot moved, relative to their declared covariance,
/// for neighbours (near) and for fixes `fix_noise_horizon` apart (far). White errors of the declared size give 1 and 1.
/// An error of correlation rho from fix to fix has near = (1 - rho) far; averaging such fixes is as good as averaging
/// white ones whose variance is (1 + rho) / (1 - rho) = (2 far - near) / near times larger. It does not depend on the
/// estimate of a filter, so that it cannot confirm its own errors.
class FixNoiseMonitor {
 public:
  /// Requires parameters without faults.
  explicit FixNoiseMonitor(const FixNoiseParameters& parameters) : parameters_(parameters) {}

  /// Takes a fix: position (m) and declared covariance (m^2); the dead-reckoned place of the antenna (m, any origin,
  /// same axes) and its accumulated variance (m^2), of which the difference between two fixes counts; the share of the
  /// distance (1) that heading and scale may be wrong by; time (s), ascending.
  void add(const Eigen::Vector2d& position, const Eigen::Matrix2d& covariance, const Eigen::Vector2d& dead_reckoned,
           double dead_reckoned_variance_m2, double distance_share, double time_s);

  void reset();

  /// Factor on the declared covariance for estimation, at least 1; 1 until there are enough fixes.
  double inflation() const;
  /// Factor on the declared covariance that gives the size of the errors, however long they last; 1 until there are
  /// enough fixes.
  double size() const;
  double near() const { return near_.mean; }
  double far() const { return far_.mean; }

 private:
  bool is_ready() const;

  struct Fix {
    Eigen::Vector2d residual;  ///< fix minus dead reckoning, m
    Eigen::Vector2d place;     ///< dead-reckoned, m
    Eigen::Matrix2d covariance;
    double variance_m2;
    double time_s;
  };
  struct Average {
    double mean{1.0};
    double count{0.0};
    void add(double value, double memory);
  };
  static double ratio(const Fix& a, const Fix& b, double distance_share);

  FixNoiseParameters parameters_;
  std::deque<Fix> fixes_;
  Average near_;
  Average far_;
};

}  // namespace urban_gnss
