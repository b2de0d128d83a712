#include "urban_gnss_localization/pipeline/correction_slew.hpp"

#include <algorithm>
#include <cmath>

namespace urban_gnss {
namespace {

/// Between the steps of the odometry's pose and of its twist (m): more is a jump of the pose, and no motion.
constexpr double kPoseJump_m = 1.0;

/// m, with 1 m for 1 rad.
double distance_m(const Pose2& a, const Pose2& b) {
  return std::max((a.position() - b.position()).norm(), std::abs(angle_difference(a.yaw, b.yaw)));
}

Pose2 between(const Pose2& from, const Pose2& to, double share) {
  const Eigen::Vector2d position = from.position() + share * (to.position() - from.position());
  return {position.x(), position.y(), wrap_angle(from.yaw + share * angle_difference(to.yaw, from.yaw))};
}

}  // namespace

std::optional<Pose2> CorrectionSlew::without_correction(const LocalizationOutput& output) const {
  if (parameters_.max_correction_speed <= 0.0 || !last_ || output.starts != last_->starts) return std::nullopt;
  const double elapsed_s = to_seconds(output.stamp - last_->stamp);
  if (elapsed_s < 0.0) return std::nullopt;
  const Pose2 step = compose(inverse(last_->odometry_pose), output.odometry_pose);
  if (distance_m(step, move({}, output.twist, elapsed_s)) > kPoseJump_m) return std::nullopt;
  return compose(map_to_odometry_, output.odometry_pose);
}

Pose2 CorrectionSlew::follow(const LocalizationOutput& output) {
  const auto shown = without_correction(output);
  behind_m_ = shown ? distance_m(*shown, output.estimate.pose) : 0.0;
  const double allowed_m = shown ? parameters_.max_correction_speed * to_seconds(output.stamp - last_->stamp) : 0.0;
  if (behind_m_ <= allowed_m) {
    map_to_odometry_ = map_to_odometry(output);
    behind_m_ = 0.0;
  } else {
    const Pose2 moved = between(*shown, output.estimate.pose, allowed_m / behind_m_);
    map_to_odometry_ = compose(moved, inverse(output.odometry_pose));
    behind_m_ -= allowed_m;
  }
  last_ = output;
  return map_to_odometry_;
}

}  // namespace urban_gnss
