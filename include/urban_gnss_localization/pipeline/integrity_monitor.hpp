#pragma once

#include <Eigen/Core>
#include <deque>
#include <limits>
#include <optional>
#include <string>

#include "urban_gnss_localization/common/parameters.hpp"
#include "urban_gnss_localization/common/stamp.hpp"

namespace urban_gnss {

/// When estimate and fixes contradict each other.
struct IntegrityParameters {
  double integrity_window{30.0};
  double integrity_limit{3.0};
  double contradiction_patience{20.0};
  double doubt_time{100.0};
  double residual_limit{5.0};

  void visit(ParameterVisitor& v) {
    v("integrity_window", integrity_window, positive(), "s",
      "time over which the estimate is compared with fixes; half of it is enough to find a contradiction");
    v("integrity_limit", integrity_limit, positive(), "",
      "median offset of the fixes from the estimate, in standard deviations, beyond which the two contradict each "
      "other");
    v("residual_limit", residual_limit, positive(), "m",
      "root mean square of a fix's range residuals (gps/satellites) beyond which it is spoilt and says nothing");
    v("contradiction_patience", contradiction_patience, non_negative(), "s",
      "time for which a contradiction must last before the estimate starts anew from fixes that agree with the "
      "odometry");
    v("doubt_time", doubt_time, positive(), "s",
      "time constant of the variance that is left of a contradiction which ended because the estimate gave way");
  }
};

/// A fix beside the estimate.
struct FixMisfit {
  Stamp stamp{0};
  Eigen::Vector2d offset{Eigen::Vector2d::Zero()};               ///< m, fix minus the antenna by the estimate
  Eigen::Matrix2d fix_covariance{Eigen::Matrix2d::Zero()};       ///< m^2, as the receiver declares it
  Eigen::Matrix2d estimate_covariance{Eigen::Matrix2d::Zero()};  ///< m^2, as it is published
  Eigen::Vector2d moved{Eigen::Vector2d::Zero()};                ///< m, by which the fix has moved the estimate since
};

/// A contradiction between the estimate and the fixes, as it stands.
struct Contradiction {
  Stamp since{0};  ///< the first fix that contradicts the estimate
  Stamp found{0};
  Eigen::Vector2d offset{Eigen::Vector2d::Zero()};  ///< m, median of the fixes from the estimate
  double sigma_m{0.0};                              ///< per axis, that estimate and fixes claim of it
};

/// For people: both numbers.
std::string describe(const Contradiction& contradiction);

/// A long-run test of the estimate: single fixes may be off by any reflection, but the median of half a minute should
/// not be, beyond what estimate and fixes claim of themselves. A filter that is wrong takes its fixes for reflections;
/// this test does not ask the filter's opinion of them. It cannot tell which of the two is wrong. So a contradiction
/// that ends because the fixes come back to the estimate leaves nothing behind; one that ends because the estimate has
/// gone to the fixes leaves the way that it went, as a variance that decays: before a door the fixes may be the wrong
/// ones.
class IntegrityMonitor {
 public:
  /// Requires parameters without faults.
  explicit IntegrityMonitor(const IntegrityParameters& parameters) : parameters_(parameters) {}

  /// Adds a fix that was compared with the estimate; stamps ascend.
  void add(const FixMisfit& misfit);
  /// The fix that was added last has moved the estimate (m, beside what the odometry says).
  void note_correction(const Eigen::Vector2d& moved);
  /// Nothing where estimate and fixes agree. It ends below two thirds of the limit.
  const std::optional<Contradiction>& contradiction() const { return contradiction_; }
  /// m^2, that covers the contradiction: the square of its offset, and of the way that the estimate has gone to the
  /// fixes because of it; 0 where there is and was none.
  Eigen::Matrix2d covariance() const;
  /// Whether a contradiction has lasted for contradiction_patience.
  bool is_persistent() const { return is_persistent_; }
  /// s from the first contradicting fix until the last contradiction was found; NaN before the first.
  double time_to_detect_s() const { return time_to_detect_s_; }
  /// s from there until it had ended; NaN while it lasts.
  double time_to_recover_s() const { return time_to_recover_s_; }

  /// Somebody has set the pose, and no fix has agreed with it yet: until then, the first that does not contradicts it.
  bool is_unconfirmed() const { return is_unconfirmed_; }

  /// The estimate is a new one: what was compared says nothing of it. Times of the last contradiction are kept.
  /// `moved`: m, from the old one to the new one; nothing where the old one meant nothing, or somebody has set the new
  /// one
  /// (`is_told`).
  void restart(bool is_told, const Eigen::Vector2d& moved = Eigen::Vector2d::Zero());
  void reset() { *this = IntegrityMonitor(parameters_); }

 private:
  void judge(Stamp now);
  /// The first fix of the window that is so far off by itself.
  Stamp first_beyond(double sigmas) const;
  void end(Stamp now);
  /// Share of the doubt's variance that is left now.
  double doubt_left() const;

  IntegrityParameters parameters_;
  std::deque<FixMisfit> window_;
  std::optional<Contradiction> contradiction_;
  bool is_persistent_{false};
  Eigen::Vector2d given_way_{Eigen::Vector2d::Zero()};  ///< m, that the estimate has gone to the fixes
  Stamp given_way_at_{0};                               ///< when the contradiction ended
  Stamp newest_{0};
  bool is_unconfirmed_{false};
  double time_to_detect_s_{std::numeric_limits<double>::quiet_NaN()};
  double time_to_recover_s_{std::numeric_limits<double>::quiet_NaN()};
};

}  // namespace urban_gnss
