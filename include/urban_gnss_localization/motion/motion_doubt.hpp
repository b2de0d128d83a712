#pragma once

#include <algorithm>

namespace urban_gnss {

/// By how much a step of odometry may be wrong beyond its model, where two sources of it contradict each other.
struct MotionDoubt {
  double position_m2{0.0};   ///< variance per axis
  double heading_rad2{0.0};  ///< variance

  bool exists() const { return position_m2 > 0.0 || heading_rad2 > 0.0; }
};

/// The doubt while two sources contradict each other. It lasts, so it is the sum of the differences that counts, not
/// the sum of their squares: the standard deviation is a share of what they have moved apart since the contradiction
/// began.
class LastingDoubt {
 public:
  /// `share`: of the difference, 0 to 1, that the source which is believed may be wrong by.
  explicit LastingDoubt(double share) : share_(share) {}

  /// One step, in which both moved apart by `difference` (m or rad): by what the variance (m^2 or rad^2) grows.
  double grow(double difference) {
    apart_ += difference;
    const double before = variance_;
    variance_ = std::max(variance_, share_ * share_ * apart_ * apart_);
    return variance_ - before;
  }
  /// The contradiction is over.
  void end() { apart_ = variance_ = 0.0; }

 private:
  double share_;
  double apart_{0.0};
  double variance_{0.0};
};

}  // namespace urban_gnss
