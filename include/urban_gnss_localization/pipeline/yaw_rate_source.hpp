#pragma once

#include <cmath>
#include <cstddef>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "urban_gnss_localization/common/parameters.hpp"
#include "urban_gnss_localization/motion/imu_mounting_check.hpp"
#include "urban_gnss_localization/motion/motion_doubt.hpp"
#include "urban_gnss_localization/motion/odometry_history.hpp"
#include "urban_gnss_localization/motion/rate_lag.hpp"
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

/// The IMU's yaw rate in place of the odometry's, as long as it comes.
///
/// A localizer that estimates the yaw rate's bias has one bias for both sources. While the odometry replaces the IMU,
/// the IMU's bias is still applied. The yaw rate is then wrong by the difference of the two biases: some hundredths of
/// a radian in 10 s. This is little beside the uncertainty that grows in that time, but too much over minutes. So a
/// change of the source is an event, and so is an IMU that contradicts the odometry.
///
/// An IMU that turns out not to tell the robot's yaw rate (ImuMountingCheck: mounted otherwise than it is told, NED,
/// degrees) is not used, or is used about the axis that gravity says is up. A single rate that is far from its
/// neighbours and from the wheels is left out and counted.
///
/// Where both contradict each other grossly, the one that is not wrong by YawRateArbiter is used, with a doubt.
///
/// An IMU whose stamps come ahead of the odometry's tells of another moment: it is not used until the robot has turned
/// for long enough to find by how much (RateLagSearch), or to find that only the odometry comes late.
class YawRateSource {
 public:
  /// `silence_s`: without a yaw rate for longer than this, the IMU is silent. Requires parameters without faults.
  YawRateSource(const YawRateParameters& parameters, double silence_s)
      : parameters_(parameters), silence_s_(silence_s), doubt_(kDoubtedShare) {}

  /// Requires stamps that ascend, and finite rates.
  void add(const ImuYawRate& rate);
  /// The same of an IMU that tells nothing but its yaw rate.
  void add(Stamp stamp, double yaw_rate_radps) { add({stamp, yaw_rate_radps, {}, std::abs(yaw_rate_radps)}); }
  /// Whether the IMU's stamps are ahead as they come (StreamOffsets).
  void set_comes_ahead(bool comes_ahead) { comes_ahead_ = comes_ahead; }
  /// s by which the IMU's stamps are ahead of the odometry's, as it was found from the rates of both; 0 until then.
  double lead_s() const { return lead_s_; }
  /// How many rates were left out, of all until now.
  std::size_t glitches() const { return glitches_; }

  /// The twist of a step of odometry that began at `since`: its yaw rate is the mean of the IMU's within the step, or
  /// the last one from up to 0.2 s before it, or the odometry's own if there is none. What changes is appended to
  /// `events`.
  Twist2 twist_of(const OdometrySample& step, Stamp since, std::vector<PipelineEvent>& events);
  /// rad^2, by what the heading's variance grew in the last step beyond the odometry's model.
  double doubt_rad2() const { return doubt_rad2_; }

  /// Whether the rate that is believed became another one in the last step, as the IMU's was not the robot's: what was
  /// turned by it until now is wrong.
  bool has_changed() const { return has_changed_; }

  /// Whether the wheels turn the robot where it does not turn, or the other way round: their speed is wrong, too.
  bool contradicts_wheels() const;
  /// Which of the two contradicts the other; empty where neither does.
  std::string complaint() const;

  void reset() { *this = YawRateSource(parameters_, silence_s_); }

 private:
  /// Of a turn that only one of the two saw, the standard deviation of the one that is believed.
  static constexpr double kDoubtedShare = 0.3;

  std::optional<ImuYawRate> mean_between(Stamp since, Stamp until, double odometry_radps,
                                         std::vector<PipelineEvent>& events);
  /// Whether rates_[i] is far from its neighbours, and from the odometry's rate where there is no later one.
  bool is_glitch(std::size_t i, double odometry_radps) const;
  void count_glitch(double rate_radps, std::vector<PipelineEvent>& events);
  /// Looks for an IMU of another clock.
  void look_for_lead(Stamp stamp, double odometry_radps, std::vector<PipelineEvent>& events);
  /// The first of rates_ that is newer than the stamp.
  std::size_t first_after(Stamp stamp) const;
  void watch(bool has_imu, double duration_s, std::vector<PipelineEvent>& events);
  void say_verdict(std::vector<PipelineEvent>& events);
  /// The IMU's rate, as far as it is the robot's; nothing where it is not.
  std::optional<double> believed(const ImuYawRate& imu) const;
  /// The rate that is believed.
  double judge(const Twist2& odometry, double imu_radps, double duration_s);

  YawRateParameters parameters_;
  double silence_s_;
  std::deque<ImuYawRate> rates_;  ///< of the last seconds
  std::size_t glitches_{0};
  std::size_t next_said_{1};  ///< which of them is said
  bool is_silent_{true};
  double without_imu_s_{0.0};  ///< of odometry, since the IMU's last yaw rate
  RateLagSearch lag_;
  double lead_s_{0.0};
  bool comes_ahead_{false};
  ImuMountingCheck mounting_;
  bool imu_is_doubted_{false};
  bool has_changed_{false};
  YawRateArbiter arbiter_;
  LastingDoubt doubt_;
  double doubt_rad2_{0.0};
};

}  // namespace urban_gnss
