#pragma once

#include <deque>
#include <optional>
#include <string>

#include "urban_gnss_localization/common/stamp.hpp"
#include "urban_gnss_localization/motion/motion_model.hpp"

namespace urban_gnss {

/// One odometry message: the twist describes the time since the message before it.
struct OdometrySample {
  Stamp stamp{0};
  Pose2 pose;  ///< base in the odometry frame, as published: what tf's odom -> base_link says
  Twist2 twist;
  bool has_pose{true};   ///< the message has one: its quaternion is not 0
  bool has_twist{true};  ///< it does not say that it has none (covariance -1)
};

/// Whether a robot can move so: below 150 m/s and 50 rad/s.
bool is_plausible(const Twist2& twist);

/// Why an odometry message was not used; empty where it can be: non-finite or absurd values, or neither pose nor twist.
std::string odometry_fault(const OdometrySample& sample);
/// Whether a yaw rate (rad/s) can be used, of the odometry or of an IMU: finite, and not beyond 50 rad/s.
bool is_usable_yaw_rate(double yaw_rate_radps);

/// The dead-reckoned path of the last seconds, so that a fix can be compared with the robot's pose at the fix's own
/// stamp. The path is integrated from the twists and starts at the origin.
class OdometryHistory {
 public:
  explicit OdometryHistory(double length_s = 10.0) : length_(from_seconds(length_s)) {}

  /// Appends a step that ends at `stamp`. Requires a stamp newer than the last.
  void add(Stamp stamp, const Twist2& twist);

  bool empty() const { return path_.empty(); }
  Stamp oldest() const { return path_.front().stamp; }
  Stamp latest() const { return path_.back().stamp; }

  /// Dead-reckoned pose at `stamp`, exact on the arcs between messages; nothing outside [oldest, latest].
  std::optional<Pose2> pose_at(Stamp stamp) const;

  /// The twist of the step that holds `stamp`; nothing outside [oldest, latest].
  std::optional<Twist2> twist_at(Stamp stamp) const;

  /// The motion from `from` to `to`, in the robot's frame at `from`; nothing where either lies outside.
  std::optional<Pose2> motion_between(Stamp from, Stamp to) const;

  void clear() { path_.clear(); }

 private:
  struct Node {
    Stamp stamp;
    Pose2 pose;
    Twist2 twist;  ///< of the step that ends here
  };
  Stamp length_;
  std::deque<Node> path_;
};

}  // namespace urban_gnss
