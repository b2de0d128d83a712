#pragma once

#include <optional>
#include <string>
#include <vector>

#include "urban_gnss_localization/motion/motion_doubt.hpp"
#include "urban_gnss_localization/motion/motion_witness.hpp"
#include "urban_gnss_localization/motion/twist_check.hpp"
#include "urban_gnss_localization/pipeline/pipeline_event.hpp"

namespace urban_gnss {

/// Makes the motion of a robot of its odometry: the twist, or the increments of the pose.
///
/// It is the twist, as long as nothing speaks against it. It is the pose
/// - where the twist is not declared (covariance -1), or absurd, or exactly 0 while the pose moves;
/// - where both contradict each other by a known mistake of the twist (TwistCheck), until fixes or the receiver's
///   velocities say which of them is right (PathWitness), and where they say that it is the pose;
/// - where messages are 0.25 s and more apart and both have agreed: between them the pose knows more.
/// A contradiction that neither fixes nor velocities have resolved is a complaint. A pose that jumps (an odometry that
/// is reset) is no motion. Where there is no pose (a quaternion of 0), the twist is integrated in its place.
class OdometrySource {
 public:
  /// Why a message cannot be used; empty where it can. A twist that is absurd is no reason, if there is a pose.
  static std::string fault_of(const OdometrySample& told);

  /// The message with the twist that moves the robot, and with a pose. Requires a message that can be used, of a stamp
  /// newer than the last.
  OdometrySample resolve(const OdometrySample& told, std::vector<PipelineEvent>& events);

  /// A fix (m, map frame), and a velocity of the receiver (m/s, east and north), once the odometry has come to their
  /// stamps.
  void add_fix(Stamp stamp, const Eigen::Vector2d& position, std::vector<PipelineEvent>& events);
  void add_velocity(Stamp stamp, const Eigen::Vector2d& velocity, std::vector<PipelineEvent>& events);

  /// Whether the last step is the first by the pose after one by the twist, or the other way round.
  bool has_changed() const { return has_changed_; }
  /// How far the steps before the change may have led astray.
  MotionDoubt doubt() const;

  /// The contradiction that is not resolved; empty where there is none.
  std::string complaint() const;
  void reset() { *this = OdometrySource(); }

 private:
  /// What moves the robot, and whether that is certain.
  struct Choice {
    bool is_pose{false};
    bool is_certain{true};
  };
  Choice choice() const;
  /// The step by the increment of the pose; nothing where the pose jumped, or one of both poses is missing.
  std::optional<Twist2> increment(const OdometrySample& told, double duration_s, std::vector<PipelineEvent>& events);
  bool is_jump(const OdometrySample& told, const Twist2& increment, double duration_s) const;
  void watch(std::vector<PipelineEvent>& events);
  void hear_witness(std::vector<PipelineEvent>& events);
  void say(PipelineEvent::Level level, const std::string& text, std::vector<PipelineEvent>& events) const {
    events.push_back({level, text});
  }

  std::optional<OdometrySample> last_;    ///< as it was told, with a pose of its own or an integrated one
  std::optional<Twist2> last_increment_;  ///< that was no jump
  int jumps_in_a_row_{0};
  bool was_by_pose_{false};
  bool has_changed_{false};
  std::optional<Stamp> said_jump_;
  bool said_no_pose_{false};
  bool said_no_twist_{false};
  bool said_absurd_{false};
  TwistCheck check_;
  TwistFinding finding_;
  PathWitness witness_;
  MotionSide side_{MotionSide::kUndecided};
  bool is_confirmed_{false};  ///< the pose, by those who cannot tell which of the two is right
};

/// For people: what contradicts what, with both numbers and the likely cause.
std::string describe(const TwistFinding& finding);

}  // namespace urban_gnss
