#pragma once

#include <optional>

#include "urban_gnss_localization/common/stamp.hpp"

namespace urban_gnss {

/// How an odometry's speed contradicts the receiver's.
enum class SpeedFault {
  kNone,
  kReversed,  ///< of the same size, but backwards: wheels that do not tell their direction
  kDead,      ///< the wheels stand, and the robot moves
  kScaled,    ///< by a factor that stays: other units, one of two wheels dead
};
const char* to_string(SpeedFault fault);

/// Forward speed at one time, by the odometry and by the receiver's velocity.
struct SpeedPair {
  Stamp stamp{0};
  double odometry_mps{0.0};
  double receiver_mps{0.0};
  double receiver_sigma_mps{0.0};
};

/// Compares an odometry's speed with the receiver's for what goes wrong with wheels. A reflection can spoil a
/// receiver's velocity for seconds, and by any amount. So a fault counts only where it has the pattern of one, for as
/// long as no reflection keeps that pattern: 1.5 s reversed, 4 s dead or scaled by 1.8 and more, 10 s scaled by less.
/// The receiver's speed must be steady, and no robot turns back without a stop, unless it is the odometry whose sign
/// changes. A fault ends once both agree for 1.5 s while the robot moves. A silence of 2.5 s begins anew.
class SpeedCheck {
 public:
  /// The fault as of this pair; stamps ascend.
  SpeedFault add(const SpeedPair& pair);
  SpeedFault fault() const { return fault_; }

 private:
  /// What one pair shows; nothing where it shows a difference without a pattern.
  std::optional<SpeedFault> pattern_of(const SpeedPair& pair) const;
  /// Whether the pair goes on as the run of its pattern did.
  bool is_steady(const SpeedPair& pair) const;

  SpeedFault fault_{SpeedFault::kNone};
  std::optional<SpeedPair> first_;  ///< of the run of pairs of one pattern
  std::optional<SpeedPair> last_;   ///< of all pairs
  std::optional<Stamp> turned_;     ///< when the robot may have begun to move the other way
  std::optional<SpeedFault> run_;   ///< its pattern
};

}  // namespace urban_gnss
