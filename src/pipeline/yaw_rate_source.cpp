#include "urban_gnss_localization/pipeline/yaw_rate_source.hpp"

#include <algorithm>
#include <iomanip>
#include <sstream>
#include <utility>

#include "limits.hpp"
#include "text.hpp"

namespace urban_gnss {
namespace {

/// An IMU that is slower than the odometry, or a message that comes late, is no reason to change the source.
constexpr double kYawRateHold_s = 0.2;
/// No robot turns that much faster from one rate to the next and back again.
constexpr double kGlitch_radps = 0.5;
constexpr double kGlitch_radps2 = 20.0;
/// Rates are kept as long as RateLagSearch asks for them.
constexpr double kKept_s = 20.0;
constexpr double kNewsworthy_s = 0.15;
/// A contradiction that is shorter is a glitch, or wheels that slip for a moment.
constexpr double kLasting_s = 1.0;
/// From where an even rate would be to where it is; else it is searched for.
constexpr int kMostSteps = 8;

/// Whether an IMU of this verdict is used as it is told to be mounted.
bool is_as_told(ImuVerdict verdict) {
  return verdict == ImuVerdict::kUnknown || verdict == ImuVerdict::kScaled || verdict == ImuVerdict::kFits;
}

}  // namespace

void YawRateSource::add(const ImuYawRate& rate) {
  while (!rates_.empty() && rates_.back().stamp >= rate.stamp) rates_.pop_back();  // the IMU's clock was set back
  rates_.push_back(rate);
  while (rates_.size() > 1 && to_seconds(rate.stamp - rates_.front().stamp) > kKept_s) rates_.pop_front();
}

Twist2 YawRateSource::twist_of(const OdometrySample& step, Stamp since, std::vector<PipelineEvent>& events) {
  Twist2 twist = step.twist;
  doubt_rad2_ = 0.0;
  has_changed_ = false;
  if (!parameters_.use_imu_yaw_rate) return twist;
  look_for_lead(step.stamp, twist.yaw_rate_radps, events);
  if (comes_ahead_ && !lag_.has_turned_enough()) return twist;
  const Stamp lead = from_seconds(lead_s_);
  const std::optional<ImuYawRate> imu = mean_between(since + lead, step.stamp + lead, twist.yaw_rate_radps, events);
  const double duration_s = to_seconds(step.stamp - since);
  watch(imu.has_value(), duration_s, events);
  if (!imu) return twist;
  const bool was_as_told = is_as_told(mounting_.verdict());
  if (mounting_.add(twist.yaw_rate_radps, *imu, duration_s)) {
    say_verdict(events);
    has_changed_ = was_as_told != is_as_told(mounting_.verdict());
  }
  if (const auto rate_radps = believed(*imu)) twist.yaw_rate_radps = judge(twist, *rate_radps, duration_s);
  return twist;
}

std::optional<double> YawRateSource::believed(const ImuYawRate& imu) const {
  switch (mounting_.verdict()) {
    case ImuVerdict::kUnknown:
    case ImuVerdict::kScaled:  // the odometry's track width may be wrong
    case ImuVerdict::kFits: return imu.told_radps;
    case ImuVerdict::kGravityFits: return imu.by_gravity_radps;
    default: return std::nullopt;
  }
}

void YawRateSource::say_verdict(std::vector<PipelineEvent>& events) {
  const bool fits = mounting_.verdict() == ImuVerdict::kFits;
  const bool was_doubted = std::exchange(imu_is_doubted_, !fits);
  if (fits) {
    if (was_doubted)
      events.push_back({PipelineEvent::Level::kInfo, "the IMU's yaw rate fits the odometry's: it is used"});
    return;
  }
  std::ostringstream text;
  text.precision(2);
  text << "the IMU's yaw rate is " << mounting_.factor() << " times the odometry's while the robot turns: ";
  switch (mounting_.verdict()) {
    case ImuVerdict::kUnknown:
    case ImuVerdict::kFits: return;
    case ImuVerdict::kGravityFits:
      text << "it is not mounted as it is told (tf, orientation); the axis is used that is up by its accelerometer";
      break;
    case ImuVerdict::kNotVertical: text << "the axis that is told is not vertical; the odometry's rate is used"; break;
    case ImuVerdict::kReversed:
      text << "is it NED, or mounted upside down, and tf does not say so? The odometry's rate is used";
      break;
    case ImuVerdict::kDegrees: text << "is it in degrees per second? The odometry's rate is used"; break;
    case ImuVerdict::kScaled: text << "its unit, or the odometry's track width?"; break;
    case ImuVerdict::kStill: text << "it says 0 about every axis; the odometry's rate is used"; break;
  }
  events.push_back({PipelineEvent::Level::kWarn, text.str()});
}

double YawRateSource::judge(const Twist2& odometry, double imu_radps, double duration_s) {
  const YawRateFault fault = arbiter_.add(odometry, imu_radps, duration_s);
  if (fault == YawRateFault::kNone) {
    doubt_.end();
  } else {
    doubt_rad2_ = doubt_.grow((imu_radps - odometry.yaw_rate_radps) * duration_s);
  }
  return fault == YawRateFault::kImu ? odometry.yaw_rate_radps : imu_radps;
}

bool YawRateSource::contradicts_wheels() const {
  return arbiter_.fault() == YawRateFault::kOdometry && arbiter_.lasted_s() >= kLasting_s;
}

std::string YawRateSource::complaint() const {
  if (arbiter_.fault() == YawRateFault::kNone || arbiter_.lasted_s() < kLasting_s) return {};
  return arbiter_.fault() == YawRateFault::kImu
             ? "the IMU's yaw rate jumped, the odometry's did not: the odometry's is used"
             : "odometry and IMU turn differently: one wheel dead, or slipping?";
}

std::size_t YawRateSource::first_after(Stamp stamp) const {
  if (rates_.empty() || stamp < rates_.front().stamp) return 0;
  if (stamp >= rates_.back().stamp) return rates_.size();
  // An IMU's stamps are nearly even: from where it would be if they were, it is not far.
  const double share =
      to_seconds(stamp - rates_.front().stamp) / to_seconds(rates_.back().stamp - rates_.front().stamp);
  const double last = static_cast<double>(rates_.size() - 1);
  auto i = static_cast<std::size_t>(std::clamp(share * last, 0.0, last));
  for (int step = 0; step < kMostSteps; ++step) {
    if (rates_[i].stamp <= stamp) {
      ++i;
    } else if (rates_[i - 1].stamp > stamp) {
      --i;
    } else {
      return i;
    }
  }
  const auto first = std::upper_bound(rates_.begin(), rates_.end(), stamp,
                                      [](Stamp value, const ImuYawRate& rate) { return value < rate.stamp; });
  return static_cast<std::size_t>(first - rates_.begin());
}

void YawRateSource::look_for_lead(Stamp stamp, double odometry_radps, std::vector<PipelineEvent>& events) {
  if (rates_.empty()) return;
  const bool is_news = lag_.add(stamp, odometry_radps, [this](Stamp at) -> std::optional<double> {
    const std::size_t i = first_after(at);
    if (i == 0 || i == rates_.size()) return std::nullopt;
    return rates_[i].told_radps;
  });
  if (!is_news) return;
  const auto found = lag_.lead_s();
  if (!found || std::abs(*found - lead_s_) < kNewsworthy_s) return;
  lead_s_ = *found;
  mounting_ = {};
  arbiter_ = {};
  std::ostringstream text;
  text << std::fixed << std::setprecision(1) << "the IMU's stamps are " << std::abs(lead_s_)
       << (lead_s_ > 0.0 ? " s ahead of" : " s behind") << " the odometry's, by the yaw rates of both: allowed for";
  events.push_back({PipelineEvent::Level::kWarn, text.str()});
}

std::optional<ImuYawRate> YawRateSource::mean_between(Stamp since, Stamp until, double odometry_radps,
                                                      std::vector<PipelineEvent>& events) {
  ImuYawRate sum;
  double gravity_count = 0.0;
  double gravity_sum = 0.0;
  int count = 0;
  const std::size_t first = first_after(since);
  for (std::size_t i = first; i < rates_.size() && rates_[i].stamp <= until; ++i) {
    const ImuYawRate& rate = rates_[i];
    if (is_glitch(i, odometry_radps)) {
      count_glitch(rate.told_radps, events);
      continue;
    }
    sum.told_radps += rate.told_radps;
    sum.any_axis_radps += rate.any_axis_radps;
    gravity_sum += rate.by_gravity_radps.value_or(0.0);
    if (rate.by_gravity_radps) ++gravity_count;
    ++count;
  }
  if (count == 0) {
    for (std::size_t i = first; i > 0 && to_seconds(since - rates_[i - 1].stamp) <= kYawRateHold_s; --i) {
      if (!is_glitch(i - 1, odometry_radps)) return rates_[i - 1];
    }
    return std::nullopt;
  }
  sum.stamp = until;
  sum.told_radps /= count;
  sum.any_axis_radps /= count;
  if (gravity_count == count) sum.by_gravity_radps = gravity_sum / count;
  return sum;
}

bool YawRateSource::is_glitch(std::size_t i, double odometry_radps) const {
  const double rate_radps = rates_[i].told_radps;
  if (!is_usable_yaw_rate(rate_radps)) return true;
  if (i == 0) return false;
  const ImuYawRate& left = rates_[i - 1];
  const bool has_right = i + 1 < rates_.size();
  const double right_radps = has_right ? rates_[i + 1].told_radps : odometry_radps;
  const double apart_s = to_seconds(rates_[i].stamp - left.stamp);
  const double limit_radps = kGlitch_radps + kGlitch_radps2 * apart_s;
  return std::abs(rate_radps - left.told_radps) > limit_radps && std::abs(rate_radps - right_radps) > limit_radps &&
         std::abs(rate_radps - odometry_radps) > limit_radps &&
         std::abs(left.told_radps - right_radps) < 0.5 * std::abs(rate_radps - left.told_radps);
}

void YawRateSource::count_glitch(double rate_radps, std::vector<PipelineEvent>& events) {
  ++glitches_;
  if (glitches_ != next_said_) return;
  next_said_ *= 10;
  std::ostringstream text;
  text.precision(3);
  text << "a yaw rate of the IMU is left out: " << rate_radps << " rad/s, far from its neighbours and the wheels ("
       << glitches_ << " until now)";
  events.push_back({PipelineEvent::Level::kWarn, text.str()});
}

void YawRateSource::watch(bool has_imu, double duration_s, std::vector<PipelineEvent>& events) {
  if (has_imu) {
    if (is_silent_) {
      events.push_back({PipelineEvent::Level::kInfo, "the IMU's yaw rate is used in place of the odometry's"});
    }
    is_silent_ = false;
    without_imu_s_ = 0.0;
    return;
  }
  without_imu_s_ += duration_s;
  if (is_silent_ || without_imu_s_ <= silence_s_) return;
  is_silent_ = true;
  events.push_back({PipelineEvent::Level::kWarn,
                    "the IMU is silent for " + seconds_text(silence_s_) + ": the odometry's yaw rate is used"});
}

}  // namespace urban_gnss
