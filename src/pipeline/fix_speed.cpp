#include "urban_gnss_localization/pipeline/fix_speed.hpp"

#include <algorithm>
#include <cmath>

namespace urban_gnss {
namespace {

constexpr double kApart_s = 3.0;
constexpr double kMostApart_s = 5.0;
/// Beyond it the chord is not the way.
constexpr double kMostTurn_rad = 0.5;
constexpr double kFading_s = 20.0;
constexpr double kLeastSigma_mps = 0.1;
/// Of the largest of some errors, the standard deviation.
constexpr double kSigmaOfLargest = 0.5;

}  // namespace

std::optional<ReceiverSpeed> FixSpeed::add(Stamp stamp, const Eigen::Vector2d& position, const OdometryHistory& path,
                                           std::optional<double> path_yaw_rad, const Eigen::Vector2d& antenna) {
  const double yaw = path.pose_at(stamp)->yaw + path_yaw_rad.value_or(0.0);
  places_.push_back({stamp, position - transform_point(Pose2{0.0, 0.0, yaw}, antenna), yaw});
  while (places_.size() > 2 && to_seconds(stamp - places_[1].stamp) >= kApart_s) places_.pop_front();
  const Place& before = places_.front();
  const double apart_s = to_seconds(stamp - before.stamp);
  if (apart_s < kApart_s || apart_s > kMostApart_s) return std::nullopt;
  if (std::abs(yaw - before.yaw_rad) > kMostTurn_rad) return std::nullopt;

  const Eigen::Vector2d velocity = (places_.back().base - before.base) / apart_s;
  const double direction = 0.5 * (yaw + before.yaw_rad);
  const Eigen::Vector2d forward(std::cos(direction), std::sin(direction));
  const double sideways_mps = std::abs(forward.x() * velocity.y() - forward.y() * velocity.x());
  ReceiverSpeed speed;
  speed.stamp = stamp;
  speed.duration_s = apart_s;
  speed.speed_mps = velocity.norm();
  if (path_yaw_rad) {
    speed.forward_mps = velocity.dot(forward);
    speed.speed_mps = std::abs(*speed.forward_mps);
  }
  speed.sigma_mps = sigma_of(path_yaw_rad ? sideways_mps : 0.0, stamp);
  return speed;
}

double FixSpeed::sigma_of(double sideways_mps, Stamp stamp) {
  if (sideways_at_) sideways_mps_ *= std::exp(-to_seconds(stamp - *sideways_at_) / kFading_s);
  sideways_at_ = stamp;
  sideways_mps_ = std::max(sideways_mps_, sideways_mps);
  return std::max(kLeastSigma_mps, kSigmaOfLargest * sideways_mps_);
}

}  // namespace urban_gnss
