#pragma once

#include <deque>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "urban_gnss_localization/common/parameters.hpp"
#include "urban_gnss_localization/motion/motion_doubt.hpp"
#include "urban_gnss_localization/motion/odometry_history.hpp"
#include "urban_gnss_localization/motion/yaw_rate_check.hpp"
#include "urban_gnss_localization/pipeline/pipeline_event.hpp"

namespace urban_gnss {

struct YawRateParameters {
  bool use_imu_yaw_rate{true};

  void visit(ParameterVisitor& v) {
    v("use_imu_yaw_rate", use_imu_yaw_rate,
      "whether imu/data is subscribed and, while available, its yaw rate replaces the odometry's");
  }
};

/// Whether an IMU's yaw rate (rad/s) can be used: finite, and of a size that the odometry's may have.
bool is_usable_yaw_rate(double yaw_rate_radps);

/// The IMU's yaw rate in place of the odometry's, as long as it comes.
///
/// A localizer that estimates the yaw rate's bias has one bias for both sources. While the odometry replaces the IMU,
/// the IMU's bias is still applied. The yaw rate is then wrong by the difference of the two biases: some hundredths of
/// a radian in 10 s. This is little beside the uncertainty that grows in that time, but too much over minutes. So a
/// change of the source is an event, and so is an IMU that contradicts the odometry.
///
/// Where both contradict each other grossly, the one that is not wrong by YawRateArbiter is used, with a doubt.
class YawRateSource {
 public:
  /// `silence_s`: without a yaw rate for longer than this, the IMU is silent. Requires parameters without faults.
  YawRateSource(const YawRateParameters& parameters, double silence_s)
      : parameters_(parameters), silence_s_(silence_s), doubt_(kDoubtedShare) {}

  /// Requires stamps that ascend, and a rate that can be used.
  void add(Stamp stamp, double yaw_rate_radps);

  /// The twist of a step of odometry that began at `since`: its yaw rate is the mean of the IMU's within the step, or
  /// the last one from up to 0.2 s before it, or the odometry's own if there is none. What changes is appended to
  /// `events`.
  Twist2 twist_of(const OdometrySample& step, Stamp since, std::vector<PipelineEvent>& events);
  /// rad^2, by what the heading's variance grew in the last step beyond the odometry's model.
  double doubt_rad2() const { return doubt_rad2_; }

  /// Whether the wheels turn the robot where it does not turn, or the other way round: their speed is wrong, too.
  bool contradicts_wheels() const;
  /// Which of the two contradicts the other; empty where neither does.
  std::string complaint() const;

  void reset() { *this = YawRateSource(parameters_, silence_s_); }

 private:
  /// Of a turn that only one of the two saw, the standard deviation of the one that is believed.
  static constexpr double kDoubtedShare = 0.3;

  std::optional<double> mean_between(Stamp since, Stamp until) const;
  void watch(std::optional<double> imu_radps, double duration_s, std::vector<PipelineEvent>& events);
  void compare(double odometry_radps, double imu_radps, double duration_s, std::vector<PipelineEvent>& events);
  /// The rate that is believed.
  double judge(const Twist2& odometry, double imu_radps, double duration_s);

  YawRateParameters parameters_;
  double silence_s_;
  std::deque<std::pair<Stamp, double>> rates_;  ///< rad/s, of the last seconds
  bool is_silent_{true};
  double without_imu_s_{0.0};                          ///< of odometry, since the IMU's last yaw rate
  std::optional<YawRateCheck> check_{YawRateCheck()};  ///< until it has found something
  YawRateArbiter arbiter_;
  LastingDoubt doubt_;
  double doubt_rad2_{0.0};
};

}  // namespace urban_gnss
