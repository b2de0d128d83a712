#include "urban_gnss_localization/pipeline/velocity_queue.hpp"

#include "limits.hpp"
#include "urban_gnss_localization/common/positive_definite.hpp"

namespace urban_gnss {
namespace {

constexpr double kMaxSpeed_mps = 150.0;

}  // namespace

std::string velocity_fault(const RawVelocity& velocity) {
  if (!velocity.velocity.allFinite()) return "not finite";
  if (velocity.velocity.norm() > kMaxSpeed_mps) return "beyond 150 m/s";
  return {};
}

std::optional<MatchedVelocity> match_velocity(const RawVelocity& velocity, const OdometryHistory& history,
                                              const Eigen::Vector2d& antenna) {
  const auto then = history.pose_at(velocity.stamp);
  if (!then) return std::nullopt;
  const Twist2 twist = *history.twist_at(velocity.stamp);
  const Eigen::Vector2d in_base(twist.speed_mps - twist.yaw_rate_radps * antenna.y(),
                                twist.lateral_mps + twist.yaw_rate_radps * antenna.x());
  const Pose2 turn{0.0, 0.0, then->yaw};
  const Pose2 turn_since{0.0, 0.0, then->yaw - history.pose_at(history.latest())->yaw};
  MatchedVelocity matched;
  matched.pair = {velocity.stamp, transform_point(turn, in_base), then->yaw, velocity.velocity, velocity.covariance};
  matched.measurement.velocity = velocity.velocity;
  matched.measurement.covariance = velocity.covariance;
  matched.measurement.time_s = to_seconds(velocity.stamp);
  matched.measurement.antenna_velocity_in_body = transform_point(turn_since, in_base);
  return matched;
}

void VelocityQueue::add(const RawVelocity& velocity) {
  const auto isotropic = [](double sigma) { return Eigen::Matrix2d(sigma * sigma * Eigen::Matrix2d::Identity()); };
  RawVelocity usable = velocity;
  if (is_positive_definite<2>(velocity.covariance)) {
    usable.covariance += isotropic(parameters_.velocity_sigma_floor);
  } else {
    usable.covariance = isotropic(parameters_.velocity_sigma_default);
  }
  // Who declares more knows nothing; the products of such numbers would be none.
  if (usable.covariance.diagonal().maxCoeff() > kMaxSpeed_mps * kMaxSpeed_mps) {
    usable.covariance = isotropic(kMaxSpeed_mps);
  }
  push_bounded(waiting_, usable);
}

std::optional<RawVelocity> VelocityQueue::take(Stamp latest_odometry) {
  if (waiting_.empty() || waiting_.front().stamp > latest_odometry) return std::nullopt;
  const RawVelocity next = waiting_.front();
  waiting_.pop_front();
  return next;
}

}  // namespace urban_gnss
