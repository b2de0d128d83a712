#pragma once

#include <complex>
#include <optional>

#include "urban_gnss_localization/motion/odometry_history.hpp"

namespace urban_gnss {

/// How an odometry's twist contradicts its own pose.
enum class TwistFault {
  kNone,
  kZero,           ///< the pose moves or turns, the twist says 0
  kOdometryFrame,  ///< the twist is in a fixed frame, not in the robot's
  kScaled,         ///< by a factor: another unit
  kReversed,       ///< the other sign
  kSwapped,        ///< a quarter turn: x and y swapped
  kPoseStands,     ///< the twist moves, the pose does not
  kUnexplained,
};

/// What was found over the last metres (or radians) of motion.
struct TwistFinding {
  TwistFault fault{TwistFault::kNone};
  bool is_of_yaw_rate{false};  ///< of the yaw rate, else of the speed
  double by_pose{0.0};         ///< m, or rad: the length of the way by the pose
  double by_twist{0.0};        ///< the same by the twist
  double factor{1.0};          ///< the twist's over the pose's, for kScaled

  bool is_same_as(const TwistFinding& other) const {
    return fault == other.fault && is_of_yaw_rate == other.is_of_yaw_rate;
  }
};

/// Compares an odometry's pose with its twist. Both are summed over half seconds, in which quantised poses and stamps
/// that jitter hardly show, and judged over 3 m, or 1.5 rad. A fault counts once two such windows in a row show it, and
/// ends once two show none; a twist that has been exactly 0 for a second counts after
/// 0.5 m (0.5 rad). Between agreement and a clear
/// contradiction nothing changes: scales that differ by a fifth, a twist that is smoothed, a pose from another sensor.
class TwistCheck {
 public:
  /// One step of an odometry that has both: from pose to pose, with the twists of both messages. Requires
  /// duration_s > 0, finite numbers and no jump of the pose.
  void add(const Pose2& from, const Pose2& to, const Twist2& before, const Twist2& twist, double duration_s);
  /// The pose jumped: what goes before it is not compared with what comes after it.
  void break_off() { block_ = {}; }

  /// The fault as of now: of the speed, or else of the yaw rate.
  const TwistFinding& finding() const { return speed_.fault.fault != TwistFault::kNone ? speed_.fault : turn_.fault; }
  /// Whether a window has shown that both agree, and no fault was found since.
  bool agrees() const { return speed_.has_agreed && finding().fault == TwistFault::kNone; }

 private:
  using Vector = std::complex<double>;
  /// Half a second.
  struct Block {
    double duration_s{0.0};
    Vector by_pose, by_twist, by_fixed_twist;  ///< m, in the odometry's frame; the last as if the twist were in it
    double pose_turn{0.0}, twist_turn{0.0};    ///< rad
  };
  /// Sums over blocks; of the turns, the imaginary parts are 0.
  struct Window {
    int count{0};
    double pose_square{0.0}, twist_square{0.0}, fixed_square{0.0};
    Vector pose_twist, pose_fixed;  ///< products with the conjugate of the twist
    double by_pose{0.0}, by_twist{0.0}, turned{0.0};
    Vector off;  ///< sum of the pose's steps less those of the twist
  };
  /// What windows have shown of the speed, or of the yaw rate.
  struct Verdict {
    Window window;
    TwistFinding last;   ///< of the last window
    TwistFinding fault;  ///< that two in a row have shown
    bool has_agreed{false};
    double zero_s{0.0};  ///< for which the twist has been exactly 0
    Vector at_zero;      ///< m or rad by the pose, since it has been 0 for a second

    explicit Verdict(bool is_of_yaw_rate) { last.is_of_yaw_rate = fault.is_of_yaw_rate = is_of_yaw_rate; }
    void judge(TwistFinding found);
  };

  void close_block();
  void look_for_zero(const Pose2& from, const Pose2& to, const Twist2& twist, double duration_s);

  Block block_;
  Verdict speed_{false};
  Verdict turn_{true};
};

}  // namespace urban_gnss
