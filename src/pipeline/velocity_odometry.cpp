#include "urban_gnss_localization/pipeline/velocity_odometry.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <optional>

#include "urban_gnss_localization/geometry/angles.hpp"
#include "urban_gnss_localization/geometry/local_frame.hpp"
#include "urban_gnss_localization/motion/motion_model.hpp"

namespace urban_gnss {
namespace {

constexpr Stamp kStep = std::chrono::milliseconds(100);
constexpr double kMaxGap_s = 2.0;
constexpr double kStanding_mps = 0.3;
constexpr double kMaxStanding_mps = 2.0;
constexpr double kMaxYawRate_radps = 2.0;
constexpr double kHalfBaseline_s = 3.0;
constexpr double kFixSigma_m = 3.0;

/// The motion at one sample.
struct Motion {
  Stamp stamp{0};
  double speed_mps{0.0};
  std::optional<double> course;  ///< rad, counter-clockwise from east; nothing at a standstill
};

double standing_speed_mps(const RawVelocity& velocity) {
  const double sigma_mps = std::sqrt(std::max(0.0, 0.5 * velocity.covariance.trace()));
  return std::clamp(2.0 * sigma_mps, kStanding_mps, kMaxStanding_mps);
}

Motion motion_between(const RawVelocity& a, const RawVelocity& b, Stamp stamp) {
  const double share = to_seconds(stamp - a.stamp) / to_seconds(b.stamp - a.stamp);
  const Eigen::Vector2d velocity = (1.0 - share) * a.velocity + share * b.velocity;
  const double speed_mps = velocity.norm();
  Motion motion;
  motion.stamp = stamp;
  if (speed_mps < std::max(standing_speed_mps(a), standing_speed_mps(b))) return motion;
  motion.speed_mps = speed_mps;
  motion.course = std::atan2(velocity.y(), velocity.x());
  return motion;
}

std::vector<RawVelocity> usable(const std::vector<RawVelocity>& velocities) {
  std::vector<RawVelocity> ascending;
  for (const RawVelocity& each : velocities) {
    if (!each.velocity.allFinite()) continue;
    if (ascending.empty() || each.stamp > ascending.back().stamp) ascending.push_back(each);
  }
  return ascending;
}

std::vector<Motion> motions_of(const std::vector<RawVelocity>& velocities) {
  std::vector<Motion> motions;
  for (std::size_t i = 1; i < velocities.size(); ++i) {
    const RawVelocity& a = velocities[i - 1];
    const RawVelocity& b = velocities[i];
    if (to_seconds(b.stamp - a.stamp) > kMaxGap_s) continue;
    if (motions.empty() || motions.back().stamp < a.stamp) motions.push_back(motion_between(a, b, a.stamp));
    for (Stamp at = a.stamp + kStep; at < b.stamp - kStep / 2; at += kStep) {
      motions.push_back(motion_between(a, b, at));
    }
    motions.push_back(motion_between(a, b, b.stamp));
  }
  return motions;
}

/// The yaw at each sample, rad: the course, and at a standstill on the way from the one before to the one behind.
std::vector<double> yaws_of(const std::vector<Motion>& motions) {
  std::vector<double> yaws(motions.size(), 0.0);
  std::optional<std::size_t> before;
  for (std::size_t i = 0; i < motions.size(); ++i) {
    if (!motions[i].course) continue;
    yaws[i] = *motions[i].course;
    const double turn = before ? wrap_angle(yaws[i] - yaws[*before]) : 0.0;
    const std::size_t first = before ? *before : 0;
    for (std::size_t k = before ? first + 1 : 0; k < i; ++k) {
      const double share = before ? to_seconds(motions[k].stamp - motions[first].stamp) /
                                        to_seconds(motions[i].stamp - motions[first].stamp)
                                  : 1.0;
      yaws[k] = before ? wrap_angle(yaws[first] + share * turn) : yaws[i];
    }
    before = i;
  }
  for (std::size_t k = before ? *before + 1 : motions.size(); k < motions.size(); ++k) yaws[k] = yaws[*before];
  return yaws;
}

}  // namespace

std::vector<OdometrySample> odometry_of_velocities(const std::vector<RawVelocity>& velocities) {
  const std::vector<Motion> motions = motions_of(usable(velocities));
  const std::vector<double> yaws = yaws_of(motions);
  std::vector<OdometrySample> samples;
  Pose2 pose;
  if (!yaws.empty()) pose.yaw = yaws.front();
  for (std::size_t i = 0; i < motions.size(); ++i) {
    OdometrySample sample;
    sample.stamp = motions[i].stamp;
    if (i > 0) {
      const double elapsed_s = to_seconds(motions[i].stamp - motions[i - 1].stamp);
      const double yaw_rate = wrap_angle(yaws[i] - pose.yaw) / elapsed_s;
      sample.twist.speed_mps = 0.5 * (motions[i - 1].speed_mps + motions[i].speed_mps);
      sample.twist.yaw_rate_radps = std::clamp(yaw_rate, -kMaxYawRate_radps, kMaxYawRate_radps);
      pose = move(pose, sample.twist, elapsed_s);
    }
    sample.pose = pose;
    samples.push_back(sample);
  }
  return samples;
}

std::vector<RawVelocity> velocities_of_fixes(const std::vector<RawFix>& fixes) {
  std::vector<RawFix> usable;
  for (const RawFix& fix : fixes) {
    if (!fix.has_fix || !position_faults(fix.position).empty()) continue;
    if (usable.empty() || fix.stamp > usable.back().stamp) usable.push_back(fix);
  }
  std::vector<RawVelocity> velocities;
  if (usable.empty()) return velocities;
  const LocalFrame frame(usable.front().position);
  std::size_t before = 0;
  std::size_t behind = 0;
  for (const RawFix& fix : usable) {
    while (to_seconds(fix.stamp - usable[before].stamp) > kHalfBaseline_s) ++before;
    while (behind + 1 < usable.size() && to_seconds(usable[behind + 1].stamp - fix.stamp) <= kHalfBaseline_s) ++behind;
    const double elapsed_s = to_seconds(usable[behind].stamp - usable[before].stamp);
    if (!(elapsed_s > 0.0)) continue;
    const Eigen::Vector3d way = frame.to_local(usable[behind].position) - frame.to_local(usable[before].position);
    const double sigma_mps = std::sqrt(2.0) * kFixSigma_m / elapsed_s;
    RawVelocity velocity;
    velocity.stamp = fix.stamp;
    velocity.velocity = way.head<2>() / elapsed_s;
    velocity.covariance = Eigen::Matrix2d::Identity() * sigma_mps * sigma_mps;
    velocities.push_back(velocity);
  }
  return velocities;
}

}  // namespace urban_gnss
