#include "urban_gnss_localization/motion/odometry_history.hpp"

#include <algorithm>
#include <cmath>

#include "urban_gnss_localization/geometry/pose_faults.hpp"

namespace urban_gnss {
namespace {

constexpr double kMaxSpeed_mps = 150.0;
constexpr double kMaxYawRate_radps = 50.0;

}  // namespace

bool is_plausible(const Twist2& twist) {
  return twist.ground_speed_mps() <= kMaxSpeed_mps && std::abs(twist.yaw_rate_radps) <= kMaxYawRate_radps;
}

bool is_usable_yaw_rate(double yaw_rate_radps) { return std::abs(yaw_rate_radps) <= kMaxYawRate_radps; }

std::string odometry_fault(const OdometrySample& sample) {
  if (!sample.has_pose && !sample.has_twist) return "neither a pose (its quaternion is 0) nor a twist (covariance -1)";
  const Twist2& twist = sample.twist;
  if (!std::isfinite(twist.speed_mps) || !std::isfinite(twist.yaw_rate_radps) || !std::isfinite(twist.lateral_mps)) {
    return "twist is not finite";
  }
  if (sample.has_pose && !is_finite(sample.pose)) return "pose is not finite";
  if (sample.has_twist && twist.ground_speed_mps() > kMaxSpeed_mps) return "speed is beyond 150 m/s";
  if (sample.has_twist && !is_usable_yaw_rate(twist.yaw_rate_radps)) return "yaw rate is beyond 50 rad/s";
  if (sample.has_pose && sample.pose.position().norm() > kMaxCoordinate_m) {
    return "pose is farther than 10 000 km from its origin";
  }
  return {};
}

void OdometryHistory::add(Stamp stamp, const Twist2& twist) {
  Node node{stamp, {}, twist};
  if (!path_.empty()) node.pose = move(path_.back().pose, twist, to_seconds(stamp - path_.back().stamp));
  path_.push_back(node);
  // One message older than the window stays, so that the window's whole length can be interpolated.
  while (path_.size() > 2 && path_[1].stamp < stamp - length_) path_.pop_front();
}

std::optional<Pose2> OdometryHistory::pose_at(Stamp stamp) const {
  if (path_.empty() || stamp < oldest() || stamp > latest()) return std::nullopt;
  const auto next = std::lower_bound(path_.begin(), path_.end(), stamp,
                                     [](const Node& node, Stamp value) { return node.stamp < value; });
  if (next->stamp == stamp) return next->pose;
  const auto previous = std::prev(next);
  return move(previous->pose, next->twist, to_seconds(stamp - previous->stamp));
}

std::optional<Twist2> OdometryHistory::twist_at(Stamp stamp) const {
  if (path_.empty() || stamp < oldest() || stamp > latest()) return std::nullopt;
  return std::lower_bound(path_.begin(), path_.end(), stamp,
                          [](const Node& node, Stamp value) { return node.stamp < value; })
      ->twist;
}

std::optional<Pose2> OdometryHistory::motion_between(Stamp from, Stamp to) const {
  const auto start = pose_at(from);
  const auto end = pose_at(to);
  if (!start || !end) return std::nullopt;
  return relative_pose(*start, *end);
}

}  // namespace urban_gnss
