#include "urban_gnss_localization/motion/motion_witness.hpp"

#include <algorithm>
#include <cmath>

namespace urban_gnss {
namespace {

/// Vectors after which older ones count half.
constexpr double kMemory = 30.0;
constexpr double kLeastVectors = 6.0;
constexpr double kMostScale = 1.33;
/// Log-likelihood ratio that decides.
constexpr double kEvidence = 5.0;
/// One of which more than this share is left agrees with nothing.
constexpr double kMostLeft = 0.5;
constexpr double kFixesApart_s = 2.9;
constexpr double kMostApart_s = 9.0;
constexpr double kVelocitiesApart_s = 0.9;
constexpr double kLeastWay_m = 1.0;
constexpr double kLeastSpeed_mps = 0.3;

std::complex<double> to_complex(const Eigen::Vector2d& vector) { return {vector.x(), vector.y()}; }

/// m/s in the frame of the path.
std::complex<double> velocity_at(const OdometryHistory& path, Stamp stamp) {
  const Twist2 twist = *path.twist_at(stamp);
  return std::polar(1.0, path.pose_at(stamp)->yaw) * std::complex<double>(twist.speed_mps, twist.lateral_mps);
}

}  // namespace

void MotionWitness::Fit::add(const std::complex<double>& measured, const std::complex<double>& told) {
  square += std::norm(told);
  product += measured * std::conj(told);
}

void MotionWitness::Fit::fade(double factor) {
  square *= factor;
  product *= factor;
}

double MotionWitness::Fit::left(double measured_square) const {
  if (!(square > 0.0)) return measured_square;
  const double scale = std::clamp(std::abs(product) / square, 1.0 / kMostScale, kMostScale);
  return std::max(measured_square + scale * scale * square - 2.0 * scale * std::abs(product), 1e-6 * measured_square);
}

void MotionWitness::add(const std::complex<double>& measured, const std::complex<double>& by_pose,
                        const std::complex<double>& by_twist) {
  if (count_ >= kMemory) {
    count_ *= 0.5;
    measured_square_ *= 0.5;
    pose_.fade(0.5);
    twist_.fade(0.5);
  }
  ++count_;
  measured_square_ += std::norm(measured);
  pose_.add(measured, by_pose);
  twist_.add(measured, by_twist);
}

MotionSide MotionWitness::side() const {
  if (count_ < kLeastVectors || !(measured_square_ > 0.0)) return MotionSide::kUndecided;
  const double by_pose = pose_.left(measured_square_);
  const double by_twist = twist_.left(measured_square_);
  if (count_ * std::log(std::max(by_pose, by_twist) / std::min(by_pose, by_twist)) < kEvidence ||
      std::min(by_pose, by_twist) > kMostLeft * measured_square_) {
    return MotionSide::kUndecided;
  }
  return by_pose < by_twist ? MotionSide::kPose : MotionSide::kTwist;
}

bool MotionWitness::fits_pose() const {
  return count_ >= kLeastVectors && pose_.left(measured_square_) < kMostLeft * measured_square_;
}

void PathWitness::add_step(Stamp stamp, const Twist2& by_pose, const Twist2& by_twist) {
  by_pose_.add(stamp, by_pose);
  by_twist_.add(stamp, by_twist);
}

void PathWitness::add_fix(Stamp stamp, const Eigen::Vector2d& position) {
  const double apart_s = last_fix_ ? to_seconds(stamp - last_fix_->stamp) : kMostApart_s;
  if (apart_s < kFixesApart_s) return;
  const auto pose = by_pose_.pose_at(stamp);
  const auto twist = by_twist_.pose_at(stamp);
  if (!pose || !twist) {
    last_fix_.reset();
    return;
  }
  if (last_fix_ && apart_s < kMostApart_s) {
    const Eigen::Vector2d pose_way = pose->position() - last_fix_->by_pose;
    const Eigen::Vector2d twist_way = twist->position() - last_fix_->by_twist;
    if (std::max(pose_way.norm(), twist_way.norm()) > kLeastWay_m) {
      fixes_.add(to_complex(position - last_fix_->position), to_complex(pose_way), to_complex(twist_way));
    }
  }
  last_fix_ = Fix{stamp, position, pose->position(), twist->position()};
}

void PathWitness::add_velocity(Stamp stamp, const Eigen::Vector2d& velocity) {
  if (last_velocity_ && to_seconds(stamp - *last_velocity_) < kVelocitiesApart_s) return;
  if (velocity.norm() < kLeastSpeed_mps || !by_pose_.pose_at(stamp)) return;
  last_velocity_ = stamp;
  velocities_.add(to_complex(velocity), velocity_at(by_pose_, stamp), velocity_at(by_twist_, stamp));
}

void PathWitness::begin_anew() {
  last_fix_.reset();
  fixes_ = {};
  velocities_ = {};
}

MotionSide PathWitness::side() const {
  const MotionSide by_velocities = velocities_.side();
  return by_velocities != MotionSide::kUndecided ? by_velocities : fixes_.side();
}

}  // namespace urban_gnss
