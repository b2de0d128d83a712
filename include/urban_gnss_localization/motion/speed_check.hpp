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

/// Forward speed at one time, by the odometry and by the receiver's velocity.
struct SpeedPair {
  Stamp stamp{0};
  double odometry_mps{0.0};
  double receiver_mps{0.0};
  double receiver_sigma_mps{0.0};
  bool odometry_jumped{false};  ///< since the pair before, in one step, by a share that no robot is likely to
  bool is_by_fixes{false};      ///< means of some seconds
};

/// Compares an odometry's speed with the receiver's for what goes wrong with wheels. A reflection can spoil a
/// receiver's velocity for seconds, and by any amount. So a fault counts only where it has the pattern of one, for as
/// long as no reflection keeps that pattern: 1.5 s reversed, 4 s dead or scaled by 1.8 and more, 10 s scaled by less; a
/// scale half as long where it began with a jump of the odometry. The receiver's speed, or its mean ratio to the
/// odometry's, must be steady, and no robot turns back without a stop, unless it is the odometry whose sign changes. A
/// fault ends once both agree for 1.5 s while the robot moves, by fixes for 6 s. A silence of 2.5 s begins anew.
class SpeedCheck {
 public:
  /// The fault as of this pair; stamps ascend.
  SpeedFault add(const SpeedPair& pair);
  SpeedFault fault() const { return fault_; }
  /// s for which pairs have shown the pattern of a fault that is not found yet; 0 where they show none.
  double suspected_for_s() const;
  /// Whether that began with a jump of the odometry: the receiver's speed is then the better one.
  bool began_with_a_jump() const { return odometry_jumped_; }

 private:
  /// What one pair shows; nothing where it shows a difference without a pattern.
  std::optional<SpeedFault> pattern_of(const SpeedPair& pair) const;
  /// Whether the pair goes on as the run of its pattern did.
  bool is_steady(const SpeedPair& pair) const;
  /// s from the first pair of the run to the last.
  double run_s() const;

  SpeedFault fault_{SpeedFault::kNone};
  std::optional<SpeedPair> first_;  ///< of the run of pairs of one pattern
  std::optional<SpeedPair> last_;   ///< of all pairs
  bool odometry_jumped_{false};     ///< when the run began
  std::optional<Stamp> turned_;     ///< when the robot may have begun to move the other way
  std::optional<SpeedFault> run_;   ///< its pattern
  int count_{0};                    ///< of the run's pairs, while it is scaled
  double ratio_{1.0};               ///< mean of the run, of the receiver's speed to the odometry's
};

}  // namespace urban_gnss
