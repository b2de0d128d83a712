#include "urban_gnss_localization/motion/twist_check.hpp"

#include <algorithm>
#include <cmath>

#include "urban_gnss_localization/motion/standstill.hpp"

namespace urban_gnss {
namespace {

constexpr double kBlock_s = 0.5;
constexpr double kWindow_m = 3.0;
constexpr double kWindow_rad = 1.5;
constexpr int kLeastBlocks = 4;
/// A pose may lag behind its twist by so much.
constexpr double kZero_s = 1.0;
constexpr double kZeroWay_m = 0.5;
constexpr double kZeroTurn_rad = 0.5;
/// Squares of the relative difference below which pose and twist agree, and beyond which they contradict each other.
constexpr double kAgree = 0.0625;
constexpr double kContradict = 0.2;
/// Yaw rates of wheels that skid, and poses whose heading is another sensor's, differ by more.
constexpr double kAgreeTurning = 0.2;
constexpr double kContradictTurning = 0.35;
/// A difference that has no name is one only where it adds up over the window, or is larger in each half second than the
/// noise of a yaw rate that is rounded, jitters or comes late. Wheels that skid differ by 0.05 rad (Husky), and turn as
/// far as their pose.
constexpr double kOffTurn_rad = 0.5;
constexpr double kOffBlock_rad = 0.1;
/// Share of the squares that a named fault may leave unexplained.
constexpr double kUnexplained = 0.06;
/// A factor that is no error of wheels.
constexpr double kLeastFactor = 1.25;
/// Squared share of the other's way that is no way.
constexpr double kNoWay = 0.01;
/// Turn in a window that tells the robot's frame from a fixed one, by leaving much less unexplained.
constexpr double kTurned_rad = 0.15;
constexpr double kBetter = 0.3;
constexpr double kExact_rad = 0.2;
constexpr double kMostScale = 1.33;

double square(double value) { return value * value; }

/// Share of the squares that is left where the pose is `factor` times the twist.
double left_by(double pose_square, double twist_square, double product, double factor) {
  const double left = pose_square + square(factor) * twist_square - 2.0 * factor * product;
  return left / std::max(pose_square, square(factor) * twist_square);
}

}  // namespace

void TwistCheck::add(const Pose2& from, const Pose2& to, const Twist2& before, const Twist2& twist, double duration_s) {
  look_for_zero(from, to, twist, duration_s);
  const double turn = angle_difference(to.yaw, from.yaw);
  // Between slow messages the twist changes: its mean is that of both.
  const Vector told(0.5 * (before.speed_mps + twist.speed_mps) * duration_s,
                    0.5 * (before.lateral_mps + twist.lateral_mps) * duration_s);
  block_.duration_s += duration_s;
  block_.by_pose += Vector(to.x - from.x, to.y - from.y);
  block_.by_twist += std::polar(1.0, from.yaw + 0.5 * turn) * told;
  block_.by_fixed_twist += told;
  block_.pose_turn += turn;
  block_.twist_turn += 0.5 * (before.yaw_rate_radps + twist.yaw_rate_radps) * duration_s;
  if (block_.duration_s >= kBlock_s) close_block();
}

void TwistCheck::look_for_zero(const Pose2& from, const Pose2& to, const Twist2& twist, double duration_s) {
  const auto look = [duration_s](bool is_zero, const Vector& step, double least, Verdict& verdict) {
    if (!is_zero) {
      verdict.zero_s = 0.0;
      verdict.at_zero = 0.0;
      return;
    }
    if (verdict.zero_s >= kZero_s) verdict.at_zero += step;
    verdict.zero_s += duration_s;
    const double far = std::abs(verdict.at_zero);
    if (far > least) verdict.fault = {TwistFault::kZero, verdict.last.is_of_yaw_rate, far, 0.0, 0.0};
  };
  look(twist.ground_speed_mps() < kStandstill_mps, {to.x - from.x, to.y - from.y}, kZeroWay_m, speed_);
  look(twist.yaw_rate_radps == 0.0, angle_difference(to.yaw, from.yaw), kZeroTurn_rad, turn_);
}

namespace {

/// Whether the pose's way is that of a twist in a fixed frame. Where the robot goes straight on, that is told from a
/// twist with another mistake by its being exactly so.
template <class Window>
bool is_of_fixed_frame(const Window& w) {
  const auto factor = w.pose_fixed / w.fixed_square;
  if (std::abs(factor) < 1.0 / kMostScale || std::abs(factor) > kMostScale) return false;
  const double left = 1.0 - std::norm(w.pose_fixed) / (w.pose_square * w.fixed_square);
  const double left_by_robot = 1.0 - std::norm(w.pose_twist) / (w.pose_square * w.twist_square);
  if (w.turned < kTurned_rad) return left < kUnexplained && std::abs(std::arg(factor)) < kExact_rad;
  return left < kUnexplained && left < kBetter * left_by_robot;
}

/// Of the windows of the speed; nothing where they lie between agreement and contradiction.
template <class Window>
std::optional<TwistFinding> judge_speed(const Window& w, TwistFault before) {
  TwistFinding found{TwistFault::kUnexplained, false, w.by_pose, w.by_twist, 1.0};
  const auto is = [&](TwistFault fault) {
    found.fault = fault;
    return found;
  };
  if (w.twist_square < kNoWay * w.pose_square && w.by_twist < kStandstillMean_mps * kBlock_s * w.count) {
    return is(TwistFault::kZero);
  }
  if (w.pose_square < kNoWay * w.twist_square && w.by_pose < kStandstillMean_mps * kBlock_s * w.count) {
    return is(TwistFault::kPoseStands);
  }
  const double difference = left_by(w.pose_square, w.twist_square, w.pose_twist.real(), 1.0);
  if (difference <= kAgree) {
    // Where the robot's frame and the fixed one are parallel, a twist in either is in both.
    if (before == TwistFault::kOdometryFrame && is_of_fixed_frame(w)) return std::nullopt;
    return is(TwistFault::kNone);
  }
  const auto factor = w.pose_twist / w.twist_square;
  const bool is_coherent = 1.0 - std::norm(w.pose_twist) / (w.pose_square * w.twist_square) < kUnexplained;
  const double angle = std::abs(std::arg(factor));
  if (is_coherent && angle < kExact_rad) {
    found.factor = 1.0 / std::abs(factor);
    const bool is_gross = found.factor > kLeastFactor || found.factor < 1.0 / kLeastFactor;
    if (!is_gross) return std::nullopt;
    return is(TwistFault::kScaled);
  }
  if (difference < kContradict) return std::nullopt;
  if (is_of_fixed_frame(w)) return is(TwistFault::kOdometryFrame);
  found.factor = 1.0 / std::abs(factor);
  if (is_coherent && angle > kPi - kExact_rad) return is(TwistFault::kReversed);
  if (is_coherent && std::abs(angle - 0.5 * kPi) < kExact_rad) return is(TwistFault::kSwapped);
  return found;
}

/// The same of the yaw rate.
template <class Window>
std::optional<TwistFinding> judge_turn(const Window& w) {
  TwistFinding found{TwistFault::kUnexplained, true, w.by_pose, w.by_twist, 1.0};
  const auto is = [&](TwistFault fault) {
    found.fault = fault;
    return found;
  };
  const double product = w.pose_twist.real();
  const double difference = left_by(w.pose_square, w.twist_square, product, 1.0);
  if (difference <= kAgreeTurning) return is(TwistFault::kNone);
  if (difference < kContradictTurning) return std::nullopt;
  if (w.twist_square < kNoWay * w.pose_square) return is(TwistFault::kZero);
  if (w.pose_square == 0.0) return is(TwistFault::kPoseStands);
  if (1.0 - square(product) / (w.pose_square * w.twist_square) > 4.0 * kUnexplained) {
    const double mean_square = (w.pose_square + w.twist_square - 2.0 * product) / w.count;
    if (std::abs(w.off) < kOffTurn_rad && mean_square < square(kOffBlock_rad)) return std::nullopt;
    return found;
  }
  found.factor = w.twist_square / product;
  return is(product < 0.0 ? TwistFault::kReversed : TwistFault::kScaled);
}

}  // namespace

void TwistCheck::Verdict::judge(TwistFinding found) {
  // A fault that has a name is not taken back for want of one.
  const bool is_vaguer = found.fault == TwistFault::kUnexplained && fault.fault != TwistFault::kNone;
  if (found.is_same_as(last) && !is_vaguer) {
    fault = found;
    has_agreed = found.fault == TwistFault::kNone;
  }
  last = found;
}

void TwistCheck::close_block() {
  const auto add = [](Window& window, const Vector& pose, const Vector& twist) {
    ++window.count;
    window.pose_square += std::norm(pose);
    window.twist_square += std::norm(twist);
    window.pose_twist += pose * std::conj(twist);
    window.by_pose += std::abs(pose);
    window.by_twist += std::abs(twist);
    window.off += pose - twist;
  };
  add(speed_.window, block_.by_pose, block_.by_twist);
  speed_.window.fixed_square += std::norm(block_.by_fixed_twist);
  speed_.window.pose_fixed += block_.by_pose * std::conj(block_.by_fixed_twist);
  speed_.window.turned += std::abs(block_.pose_turn);
  add(turn_.window, block_.pose_turn, block_.twist_turn);
  block_ = {};

  const auto is_full = [](const Window& window, double length) {
    return window.count >= kLeastBlocks && std::max(window.by_pose, window.by_twist) >= length;
  };
  if (is_full(speed_.window, kWindow_m)) {
    if (const auto found = judge_speed(speed_.window, speed_.fault.fault)) speed_.judge(*found);
    speed_.window = {};
  }
  if (is_full(turn_.window, kWindow_rad)) {
    if (const auto found = judge_turn(turn_.window)) turn_.judge(*found);
    turn_.window = {};
  }
}

}  // namespace urban_gnss
