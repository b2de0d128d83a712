#include "urban_gnss_localization/pipeline/odometry_source.hpp"

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <sstream>

namespace urban_gnss {

using Level = PipelineEvent::Level;

namespace {

/// Messages that are farther apart are slow: a twist at their end says little of the time between them.
constexpr double kSlow_s = 0.25;
/// A pose may be off from what was expected by a part of the way, by an acceleration, and by its rounding.
constexpr double kJump_m = 0.3;
constexpr double kJumpShare = 0.5;
constexpr double kJump_mps2 = 10.0;
constexpr double kJump_rad = 0.3;
constexpr double kJump_radps2 = 10.0;
/// A pose that is nearer than this to the origin, from farther away than one that it could come from, is one that was
/// reset.
constexpr double kOrigin_m = 0.3;
constexpr double kOriginFrom_m = 1.0;
constexpr double kSayJumpAgain_s = 60.0;
/// After which a pose that "jumps" is one that moves so.
constexpr int kMostJumps = 3;
/// A twist may be in other units, but not beyond 150 m/s in mm/s.
constexpr double kMostAbsurd = 1.5e5;
/// In which TwistCheck finds a fault.
constexpr double kWindowsToFind = 2.0;

/// A factor by which a twist is larger than it should be, and its name.
struct Unit {
  double factor;
  const char* question;
};
constexpr Unit kSpeedUnits[] = {{1000.0, "is the twist in mm/s?"},  {100.0, "is the twist in cm/s?"},
                                {3.6, "is the twist in km/h?"},     {2.2369, "is the twist in miles per hour?"},
                                {1.9438, "is the twist in knots?"}, {0.001, "is the pose in mm, or the twist in km/s?"},
                                {0.01, "is the pose in cm?"}};
constexpr Unit kYawRateUnits[] = {{57.296, "is the yaw rate in degrees per second?"},
                                  {0.017453, "is the yaw rate in radians, and was it converted to them twice?"}};
constexpr double kUnitTolerance = 0.08;  ///< relative; wheels are wrong by some percent

template <std::size_t N>
const Unit* unit_of(double factor, const Unit (&units)[N]) {
  const auto off = [factor](const Unit& unit) { return std::abs(std::log(std::abs(factor) / unit.factor)); };
  const auto nearest = std::min_element(std::begin(units), std::end(units),
                                        [&](const Unit& a, const Unit& b) { return off(a) < off(b); });
  return off(*nearest) < kUnitTolerance ? nearest : nullptr;
}

const Unit* unit_of(const TwistFinding& finding) {
  return finding.is_of_yaw_rate ? unit_of(finding.factor, kYawRateUnits) : unit_of(finding.factor, kSpeedUnits);
}

std::string cause_of(const TwistFinding& finding) {
  switch (finding.fault) {
    case TwistFault::kNone: return "";
    case TwistFault::kZero: return finding.is_of_yaw_rate ? "the twist has no yaw rate" : "the twist is not filled in";
    case TwistFault::kOdometryFrame: return "is the twist in the odometry's frame, not in the robot's?";
    case TwistFault::kReversed: return finding.is_of_yaw_rate ? "the sign of the yaw rate?" : "the sign of the speed?";
    case TwistFault::kSwapped: return "are x and y swapped?";
    case TwistFault::kPoseStands: return "the pose is not filled in";
    case TwistFault::kScaled: {
      const Unit* unit = unit_of(finding);
      if (unit != nullptr) return unit->question;
      std::ostringstream text;
      text << std::setprecision(3) << "a factor of " << finding.factor << ": wrong units, or a wrong wheel radius?";
      return text.str();
    }
    case TwistFault::kUnexplained:
      return "not at the same times, or not in the same direction: is the twist, or the pose, of another frame?";
  }
  return "";
}

/// Whether the fault is known to be the twist's, or the pose's, by its kind.
MotionSide likely_side(const TwistFinding& finding) {
  switch (finding.fault) {
    case TwistFault::kZero:
    case TwistFault::kOdometryFrame:
    case TwistFault::kReversed:
    case TwistFault::kSwapped: return MotionSide::kPose;
    case TwistFault::kPoseStands: return MotionSide::kTwist;
    case TwistFault::kScaled: {
      const Unit* unit = unit_of(finding);
      if (unit == nullptr) return MotionSide::kUndecided;
      return unit->factor > 1.0 || finding.is_of_yaw_rate ? MotionSide::kPose : MotionSide::kTwist;
    }
    case TwistFault::kNone:
    case TwistFault::kUnexplained: break;
  }
  return MotionSide::kUndecided;
}

}  // namespace

std::string describe(const TwistFinding& finding) {
  const char* unit = finding.is_of_yaw_rate ? " rad" : " m";
  std::ostringstream text;
  text << std::setprecision(3) << "the odometry contradicts itself: its pose "
       << (finding.is_of_yaw_rate ? "turned " : "moved ") << finding.by_pose << unit << ", by its twist it is "
       << finding.by_twist << unit << ": " << cause_of(finding);
  return text.str();
}

OdometrySource::Choice OdometrySource::choice() const {
  if (finding_.fault == TwistFault::kNone) return {};
  if (finding_.fault == TwistFault::kZero) return {true, true};
  if (finding_.fault == TwistFault::kPoseStands) return {false, true};
  if (side_ != MotionSide::kUndecided) return {side_ == MotionSide::kPose, true};
  return {likely_side(finding_) == MotionSide::kPose, is_confirmed_};
}

std::string OdometrySource::fault_of(const OdometrySample& told) {
  OdometrySample without_twist = told;
  const double largest = std::max(told.twist.ground_speed_mps(), std::abs(told.twist.yaw_rate_radps));
  if (told.has_pose && largest <= kMostAbsurd && !is_plausible(told.twist)) without_twist.has_twist = false;
  return odometry_fault(without_twist);
}

MotionDoubt OdometrySource::doubt() const {
  if (!has_changed_ || finding_.fault == TwistFault::kNone) return {};
  const double apart = kWindowsToFind * finding_.by_pose;
  if (finding_.is_of_yaw_rate) return {0.0, std::min(apart * apart, kPi * kPi / 3.0)};
  return {apart * apart, 0.0};
}

OdometrySample OdometrySource::resolve(const OdometrySample& told, std::vector<PipelineEvent>& events) {
  OdometrySample resolved = told;
  const double duration_s = last_ ? to_seconds(told.stamp - last_->stamp) : 0.0;
  const bool has_twist = told.has_twist && is_plausible(told.twist);
  if (told.has_twist && !has_twist && !said_absurd_) {
    said_absurd_ = true;
    std::ostringstream text;
    text << std::setprecision(3) << "the odometry's twist is absurd: " << told.twist.ground_speed_mps() << " m/s, "
         << told.twist.yaw_rate_radps << " rad/s (in mm/s, or degrees?); while it is, the pose's increments are used";
    say(Level::kWarn, text.str(), events);
  }
  if (!told.has_twist && !said_no_twist_) {
    said_no_twist_ = true;
    say(Level::kInfo, "the odometry declares no twist (covariance -1): the pose's increments are used", events);
  }
  std::optional<Twist2> by_pose;
  if (told.has_pose) {
    if (last_ && duration_s > 0.0) by_pose = increment(told, duration_s, events);
    if (by_pose && told.has_twist) {
      check_.add(last_->pose, told.pose, last_->has_twist ? last_->twist : told.twist, told.twist, duration_s);
      witness_.add_step(told.stamp, *by_pose, has_twist ? told.twist : Twist2{});
      watch(events);
    }
  } else if (!said_no_pose_) {
    said_no_pose_ = true;
    say(Level::kWarn,
        "the odometry has no pose (its quaternion is 0): the twist is integrated in its place; map -> odom fits an "
        "odom -> base_link that is the same integral",
        events);
  }

  const bool is_slow = duration_s > kSlow_s && check_.agrees();
  const bool by_increment = !has_twist || choice().is_pose || is_slow;
  if (by_increment && by_pose) {
    resolved.twist = *by_pose;
  } else if (!has_twist) {
    resolved.twist = last_increment_.value_or(Twist2{});  // across a jump of the pose
  }
  const bool is_by_pose = by_increment && !is_slow;
  has_changed_ = last_ && is_by_pose != was_by_pose_;
  was_by_pose_ = is_by_pose;
  if (!told.has_pose) resolved.pose = last_ ? move(last_->pose, resolved.twist, duration_s) : Pose2{};
  last_ = told;
  last_->pose = resolved.pose;
  return resolved;
}

std::optional<Twist2> OdometrySource::increment(const OdometrySample& told, double duration_s,
                                                std::vector<PipelineEvent>& events) {
  if (!last_->has_pose) return std::nullopt;
  const Twist2 found = twist_between(last_->pose, told.pose, duration_s);
  if (jumps_in_a_row_ < kMostJumps && is_jump(told, found, duration_s)) {
    ++jumps_in_a_row_;
    check_.break_off();
    if (!said_jump_ || to_seconds(told.stamp - *said_jump_) > kSayJumpAgain_s) {
      said_jump_ = told.stamp;
      std::ostringstream text;
      text << std::fixed << std::setprecision(1) << "the odometry's pose jumped by "
           << (told.pose.position() - last_->pose.position()).norm() << " m and "
           << std::abs(angle_difference(told.pose.yaw, last_->pose.yaw)) << " rad, to x " << told.pose.x << ", y "
           << told.pose.y << ": was it reset? It is not taken for motion";
      say(Level::kWarn, text.str(), events);
    }
    return std::nullopt;
  }
  jumps_in_a_row_ = 0;
  last_increment_ = found;
  return found;
}

bool OdometrySource::is_jump(const OdometrySample& told, const Twist2& increment, double duration_s) const {
  const auto is_unlike = [&](const Twist2& expected) {
    const Pose2 there = move(last_->pose, expected, duration_s);
    const double speed_mps = increment.ground_speed_mps();
    const double far_m = (told.pose.position() - there.position()).norm();
    const bool is_reset = told.pose.position().norm() < kOrigin_m && last_->pose.position().norm() > kOriginFrom_m &&
                          there.position().norm() > kOriginFrom_m && far_m > kJumpShare * speed_mps * duration_s;
    const double turn = std::abs(angle_difference(told.pose.yaw, there.yaw));
    return is_reset ||
           far_m > kJump_m + (kJumpShare * expected.ground_speed_mps() + 0.5 * kJump_mps2 * duration_s) * duration_s ||
           turn > kJump_rad +
                      (kJumpShare * std::abs(expected.yaw_rate_radps) + 0.5 * kJump_radps2 * duration_s) * duration_s;
  };
  if (!last_increment_) return false;
  const bool has_twist = told.has_twist && finding_.fault != TwistFault::kZero;
  return (!has_twist || is_unlike(told.twist)) && is_unlike(*last_increment_);
}

void OdometrySource::watch(std::vector<PipelineEvent>& events) {
  const TwistFinding& found = check_.finding();
  if (found.is_same_as(finding_)) {
    if (found.fault != TwistFault::kNone) finding_ = found;
    return;
  }
  const bool had_fault = finding_.fault != TwistFault::kNone;
  finding_ = found;
  side_ = MotionSide::kUndecided;
  is_confirmed_ = false;
  witness_.begin_anew();
  if (found.fault == TwistFault::kNone) {
    if (had_fault) say(Level::kInfo, "the odometry's pose and twist agree again", events);
    return;
  }
  say(Level::kWarn,
      describe(found) + (choice().is_pose ? " The pose's increments are used" : " The twist is used") +
          (choice().is_certain ? "" : ", until fixes tell which is right"),
      events);
}

void OdometrySource::add_fix(Stamp stamp, const Eigen::Vector2d& position, std::vector<PipelineEvent>& events) {
  if (finding_.fault == TwistFault::kNone) return;
  witness_.add_fix(stamp, position);
  hear_witness(events);
}

void OdometrySource::add_velocity(Stamp stamp, const Eigen::Vector2d& velocity, std::vector<PipelineEvent>& events) {
  if (finding_.fault == TwistFault::kNone) return;
  witness_.add_velocity(stamp, velocity);
  hear_witness(events);
}

void OdometrySource::hear_witness(std::vector<PipelineEvent>& events) {
  if (choice().is_certain) return;
  side_ = witness_.side();
  const bool is_a_turn = finding_.fault == TwistFault::kReversed || finding_.fault == TwistFault::kSwapped;
  is_confirmed_ = is_a_turn && !finding_.is_of_yaw_rate && witness_.fits_pose();
  if (!choice().is_certain) return;
  say(Level::kWarn,
      std::string("the receiver agrees with the odometry's ") +
          (choice().is_pose ? "pose: its increments are used" : "twist: it is used, and odom -> base_link is wrong"),
      events);
}

std::string OdometrySource::complaint() const { return choice().is_certain ? std::string() : describe(finding_); }

}  // namespace urban_gnss
