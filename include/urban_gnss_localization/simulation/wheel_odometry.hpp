#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "urban_gnss_localization/common/parameters.hpp"
#include "urban_gnss_localization/common/random.hpp"
#include "urban_gnss_localization/geometry/pose2.hpp"
#include "urban_gnss_localization/motion/motion_model.hpp"
#include "urban_gnss_localization/simulation/sample_clock.hpp"
#include "urban_gnss_localization/simulation/vehicle.hpp"

namespace urban_gnss {

/// Errors of the size seen in recordings: speed scale 0.3-2.5 %, yaw-rate bias 0.001-0.006 rad/s. The wheels of a
/// Segway on a campus are worse: scenarios/campus_segway.yaml has theirs.
struct WheelOdometryParameters {
  double rate{50.0};
  double speed_scale{1.0};
  double speed_scale_sigma{0.01};
  double speed_scale_wander_sigma{0.0};
  double speed_scale_wander_time{10.0};
  double yaw_rate_scale_sigma{0.01};
  double yaw_rate_bias_sigma{0.003};
  double yaw_rate_bias_walk{5e-5};
  double yaw_rate_wander_sigma{0.0};
  double yaw_rate_wander_time{1.0};
  double speed_noise_density{0.005};
  double yaw_rate_noise_density{5e-4};
  double tick{0.0005};
  double steering_resolution{0.001};
  double track_width{1.5};
  double slip_interval{120.0};
  double slip_duration{0.5};
  double slip_share{0.2};

  void visit(ParameterVisitor& v) {
    v("rate", rate, between(1.0, 1000.0), "", "Hz");
    v("speed_scale", speed_scale, between(0.5, 2.0), "",
      "mean factor on the speed: wheels that are not as big as said");
    v("speed_scale_sigma", speed_scale_sigma, between(0.0, 0.2), "", "of the factor on the speed, drawn once a run");
    v("speed_scale_wander_sigma", speed_scale_wander_sigma, between(0.0, 0.2), "",
      "of what the factor on the speed wanders about it; 0: no wandering");
    v("speed_scale_wander_time", speed_scale_wander_time, positive(), "s", "correlation time of this wandering");
    v("yaw_rate_scale_sigma", yaw_rate_scale_sigma, between(0.0, 0.2), "",
      "of the factor on the yaw rate, drawn once a run");
    v("yaw_rate_bias_sigma", yaw_rate_bias_sigma, non_negative(), "rad/s", "of the bias at the start");
    v("yaw_rate_bias_walk", yaw_rate_bias_walk, non_negative(), "", "rad/s/sqrt(s)");
    v("yaw_rate_wander_sigma", yaw_rate_wander_sigma, non_negative(), "rad/s",
      "of an error of the yaw rate that comes and goes while the robot moves; 0: none");
    v("yaw_rate_wander_time", yaw_rate_wander_time, positive(), "s", "correlation time of this error");
    v("speed_noise_density", speed_noise_density, non_negative(), "", "m/s/sqrt(Hz)");
    v("yaw_rate_noise_density", yaw_rate_noise_density, non_negative(), "", "rad/s/sqrt(Hz)");
    v("tick", tick, non_negative(), "m", "of wheel travel per encoder tick; 0: none");
    v("steering_resolution", steering_resolution, non_negative(), "rad", "for bicycle; 0: none");
    v("track_width", track_width, positive(), "m", "between the wheels, for differential");
    v("slip_interval", slip_interval, non_negative(), "s", "mean time from the end of a slip to the next; 0: no slip");
    v("slip_duration", slip_duration, positive(), "", "s");
    v("slip_share", slip_share, between(0.0, 10.0), "", "extra turn of a slipping wheel, as a share of its turn");
  }
};

struct WheelOdometryMessage {
  double stamp_s{0.0};            ///< since the start
  Twist2 twist;                   ///< mean over the time since the last message
  double speed_variance{0.0};     ///< (m/s)^2
  double yaw_rate_variance{0.0};  ///< (rad/s)^2
  Pose2 pose;                     ///< in the odom frame, integrated from the twists; starts at the origin
};

/// Encoders on the wheels of a Vehicle.
///
/// Speed v and yaw rate w are measured as (s + a + c(t)) v + noise and (1 + b) w + bias(t) + d(t) + noise. a, b are
/// drawn once; c, d wander as stationary first-order Gauss-Markov processes, so that d of sigma S and time T turns the
/// heading by a random walk of S sqrt(2 T) rad/sqrt(s) in the long run. Then come slip, which starts and ends with a
/// step, and quantisation: for bicycle the driven axle has one encoder, which slips as a whole, and the steering angle
/// a resolution, yaw rate by eq. (4); for differential each wheel has an encoder, and one of them at random slips.
/// Ticks are counted from the start, so that quantisation does not add up. A robot that stands turns no wheel: its
/// messages are exactly zero.
///
/// The variances are those of the error of one message over all runs: noise density^2 * rate, tick^2/6 per message
/// period^2 (the difference of two uniform errors), steering resolution^2/12, (scale sigma * twist)^2, initial bias and
/// its walk up to now, the wandering, and the mean square of slip; not the mean scale s, which is nowhere known. At a
/// stand they are therefore too large; and the errors from scale, bias and wandering stay from message to message,
/// which a filter that takes them for white does not know.
class WheelOdometry {
 public:
  /// `wheelbase_m` is used for bicycle only. Requires parameters without faults.
  WheelOdometry(const WheelOdometryParameters& parameters, Drive drive, double wheelbase_m, std::uint64_t seed);

  /// The robot truly moved with `truth` for `dt_s` > 0. A message falls due every 1/rate s, also within a step; where
  /// several fall due in one step, all are integrated and the last is returned.
  std::optional<WheelOdometryMessage> advance(const Twist2& truth, double dt_s);

  /// What a localizer cannot know: the factors, the bias and the wandering, as they are now.
  double speed_scale() const {
    return parameters_.speed_scale + speed_scale_error_ + parameters_.speed_scale_wander_sigma * speed_scale_wander_;
  }
  double yaw_rate_scale() const { return 1.0 + yaw_rate_scale_error_; }
  double yaw_rate_bias_radps() const { return bias_radps_; }
  double yaw_rate_wander_radps() const { return parameters_.yaw_rate_wander_sigma * yaw_rate_wander_; }
  bool is_slipping() const { return is_slipping_; }
  /// In the odom frame, as of the last message.
  const Pose2& pose() const { return pose_; }

 private:
  /// An encoder that counts whole ticks.
  class Encoder {
   public:
    explicit Encoder(double tick_m) : tick_m_(tick_m) {}
    void turn(double distance_m) { travelled_m_ += distance_m; }
    /// Whole ticks since the last call, m.
    double read();

   private:
    double tick_m_;
    double travelled_m_{0.0};
    double read_m_{0.0};
  };

  void turn_wheels(const Twist2& truth, double dt_s);
  void advance_slip();
  WheelOdometryMessage message();
  Twist2 read_bicycle(double distance_m, double yaw_rad);
  Twist2 read_differential(double distance_m, double yaw_rad);
  void set_variances(WheelOdometryMessage& message) const;
  double slip_probability() const;

  WheelOdometryParameters parameters_;
  Drive drive_;
  double wheelbase_m_;
  RandomEngine engine_;
  RandomEngine slip_engine_;
  RandomEngine wander_engine_;
  SampleClock clock_;
  double time_s_{0.0};
  double speed_scale_error_{0.0};
  double yaw_rate_scale_error_{0.0};
  double bias_radps_{0.0};
  double speed_scale_wander_{0.0};  ///< of variance 1
  double yaw_rate_wander_{0.0};     ///< likewise
  bool is_slipping_{false};
  bool slips_left_{false};
  double slip_change_s_{0.0};  ///< when the slip starts or ends
  Encoder left_;               ///< the only one for bicycle
  Encoder right_;
  // Since the last message:
  bool has_moved_{false};
  double distance_m_{0.0};   ///< without noise, slip and quantisation
  double yaw_rad_{0.0};      ///< likewise
  double left_slip_m_{0.0};  ///< extra turn of the wheels
  double right_slip_m_{0.0};
  Pose2 pose_;
};

}  // namespace urban_gnss
