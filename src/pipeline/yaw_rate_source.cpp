#include "urban_gnss_localization/pipeline/yaw_rate_source.hpp"

#include <sstream>

#include "limits.hpp"
#include "text.hpp"

namespace urban_gnss {
namespace {

/// An IMU that is slower than the odometry, or a message that comes late, is no reason to change the source.
constexpr double kYawRateHold_s = 0.2;
/// An IMU's yaw rate may be smaller than that of wheels that slip, but not in the other direction, nor larger than in
/// degrees.
constexpr double kMaxYawRateFactor = 10.0;
/// A contradiction that is shorter is a glitch, or wheels that slip for a moment.
constexpr double kLasting_s = 1.0;

}  // namespace

bool is_usable_yaw_rate(double yaw_rate_radps) {
  OdometrySample as_odometry;
  as_odometry.twist.yaw_rate_radps = yaw_rate_radps;
  return odometry_fault(as_odometry).empty();
}

void YawRateSource::add(Stamp stamp, double yaw_rate_radps) {
  rates_.emplace_back(stamp, yaw_rate_radps);
  while (rates_.size() > 1 && to_seconds(stamp - rates_.front().first) > kHistory_s) rates_.pop_front();
}

Twist2 YawRateSource::twist_of(const OdometrySample& step, Stamp since, std::vector<PipelineEvent>& events) {
  Twist2 twist = step.twist;
  doubt_rad2_ = 0.0;
  if (!parameters_.use_imu_yaw_rate) return twist;
  const std::optional<double> imu_radps = mean_between(since, step.stamp);
  const double duration_s = to_seconds(step.stamp - since);
  watch(imu_radps, duration_s, events);
  if (!imu_radps) return twist;
  compare(twist.yaw_rate_radps, *imu_radps, duration_s, events);
  twist.yaw_rate_radps = judge(twist, *imu_radps, duration_s);
  return twist;
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

std::optional<double> YawRateSource::mean_between(Stamp since, Stamp until) const {
  double sum = 0.0;
  int count = 0;
  std::optional<double> before;
  for (const auto& [stamp, rate] : rates_) {
    if (stamp > until) break;
    if (stamp > since) {
      sum += rate;
      ++count;
    } else if (to_seconds(since - stamp) <= kYawRateHold_s) {
      before = rate;
    }
  }
  return count > 0 ? sum / count : before;
}

void YawRateSource::watch(std::optional<double> imu_radps, double duration_s, std::vector<PipelineEvent>& events) {
  if (imu_radps) {
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

void YawRateSource::compare(double odometry_radps, double imu_radps, double duration_s,
                            std::vector<PipelineEvent>& events) {
  if (!check_) return;
  const auto factor = check_->add(odometry_radps, imu_radps, duration_s);
  if (!factor || (*factor > 0.0 && *factor < kMaxYawRateFactor)) return;
  std::ostringstream text;
  text.precision(2);
  text << "the IMU's yaw rate is " << *factor << " times the odometry's in a minute of turning: is it "
       << (*factor > 0.0 ? "in degrees?" : "mounted upside down, without an orientation in its messages?");
  events.push_back({PipelineEvent::Level::kWarn, text.str()});
  check_.reset();
}

}  // namespace urban_gnss
