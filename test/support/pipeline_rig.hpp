#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <map>
#include <memory>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "matchers.hpp"
#include "urban_gnss_localization/localizers/nishida/particle_filter.hpp"
#include "urban_gnss_localization/pipeline/localization_pipeline.hpp"

namespace urban_gnss {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();
const GeodeticPosition kDatum{33.0, 130.0, 20.0};

/// Dead-reckons, believes every fix without moving, and remembers what it was asked.
struct FakeLocalizer : Localizer {
  bool wants{false};
  bool breaks{false};  ///< its pose becomes NaN at the next fix
  PoseEstimate state;
  std::vector<PoseEstimate> starts;
  std::vector<std::pair<Twist2, double>> moves;
  MotionDoubt doubted;
  std::vector<FixMeasurement> fixes;
  bool printed{false};  ///< is as its paper prints it
  bool takes{true};     ///< velocities
  std::vector<VelocityMeasurement> velocities;
  std::vector<HeadingMeasurement> headings;
  bool takes_sky{true};  ///< satellites
  bool gated{false};     ///< has a gate
  double nis{kNaN};      ///< of each fix
  double mass{kNaN};     ///< of the heaviest cluster

  const char* name() const override { return "fake"; }
  std::string mode() const override { return "fake"; }
  bool is_as_printed() const override { return printed; }
  bool wants_bias() const override { return wants; }
  void initialize(const PoseEstimate& start) override {
    starts.push_back(start);
    state = start;
  }
  void move(const Twist2& twist, double duration_s) override {
    moves.emplace_back(twist, duration_s);
    state.pose = urban_gnss::move(state.pose, twist, duration_s);
  }
  void doubt(const MotionDoubt& doubt) override {
    doubted.position_m2 += doubt.position_m2;
    doubted.heading_rad2 += doubt.heading_rad2;
  }
  FixOutcome correct(const FixMeasurement& fix) override {
    fixes.push_back(fix);
    if (breaks) state.pose.x = kNaN;
    FixOutcome outcome;
    outcome.decision = FixDecision::kAccepted;
    outcome.nis = nis;
    return outcome;
  }
  bool gates() const override { return gated; }
  bool takes_velocity() const override { return takes; }
  void correct_velocity(const VelocityMeasurement& velocity) override { velocities.push_back(velocity); }
  bool takes_heading() const override { return true; }
  void correct_heading(const HeadingMeasurement& heading) override { headings.push_back(heading); }
  bool takes_satellites() const override { return takes_sky; }
  Pose2 pose() const override { return state.pose; }
  PoseEstimate estimate() const override { return state; }
  LocalizerHealth health() const override {
    LocalizerHealth health;
    health.heading_sigma_rad = std::sqrt(state.covariance(2, 2));
    health.cluster_mass = mass;
    return health;
  }
};

inline RawFix raw_fix(Stamp stamp, const Eigen::Vector2d& position, double sigma = 1.0) {
  static const LocalFrame frame(kDatum);
  RawFix fix;
  fix.stamp = stamp;
  fix.position = frame.to_geodetic({position.x(), position.y(), 0.0});
  fix.covariance = sigma * sigma * Eigen::Matrix3d::Identity();
  fix.covariance_type = CovarianceType::kKnown;
  return fix;
}

/// The pipeline with a fake localizer, or another, and a robot that drives an arc at 2 m/s and 0.1 rad/s from
/// (0, 0, 0) at time 0. Its map frame is that of kDatum, its odometry frame is another.
struct Rig {
  static constexpr Twist2 kTwist{2.0, 0.1};
  FakeLocalizer* fake{nullptr};
  LocalizationPipeline pipeline;

  explicit Rig(const std::string& yaml, bool wants_bias = false)
      : Rig(with(LocalizationParameters{}, yaml), std::make_unique<FakeLocalizer>()) {
    fake->wants = wants_bias;
  }
  Rig(const LocalizationParameters& parameters, std::unique_ptr<Localizer> localizer)
      : fake(dynamic_cast<FakeLocalizer*>(localizer.get())), pipeline(parameters, std::move(localizer)) {}

  static Stamp at(double time) { return from_seconds(1000.0 + time); }
  static Pose2 truth(double time) { return move({}, kTwist, time); }
  static OdometrySample odometry(double time) { return {at(time), compose({-7.0, 5.0, 1.0}, truth(time)), kTwist}; }
  void drive(double time) { pipeline.add_odometry(odometry(time)); }
  void fix(double time, const Eigen::Vector2d& error = {0.0, 0.0}, const Eigen::Vector2d& antenna = {0.0, 0.0}) {
    pipeline.add_fix(raw_fix(at(time), transform_point(truth(time), antenna) + error));
  }
  /// The receiver's velocity, east and north, without an error.
  static RawVelocity velocity(double time, const Eigen::Vector2d& antenna = {0.0, 0.0}) {
    RawVelocity velocity;
    velocity.stamp = at(time);
    const double yaw = truth(time).yaw;
    const double forward = kTwist.speed_mps - kTwist.yaw_rate_radps * antenna.y();
    const double left = kTwist.yaw_rate_radps * antenna.x();
    velocity.velocity = {std::cos(yaw) * forward - std::sin(yaw) * left,
                         std::sin(yaw) * forward + std::cos(yaw) * left};
    velocity.covariance = isotropic(0.1);
    return velocity;
  }
  /// Odometry at 10 Hz, and a fix each second unless there shall be none.
  void run(double from, double to, bool with_fixes = true) {
    for (long k = std::lround(10.0 * from); k <= std::lround(10.0 * to); ++k) {
      if (with_fixes && k % 10 == 0) fix(0.1 * k);
      drive(0.1 * k);
    }
  }
  void bias(double time, double radius, FixDecision decision = FixDecision::kAccepted) {
    BiasEstimate bias;
    bias.stamp = at(time);
    bias.radius_m = radius;
    bias.outcome.decision = decision;
    bias.outcome.stamp = bias.stamp;
    pipeline.add_bias(bias);
  }
  LocalizationState state() const { return pipeline.report().state; }
};

/// Where and when the robot is known from the first message on.
const char* const kGiven = "{datum: [33.0, 130.0, 20.0], initial_pose: [0.0, 0.0, 0.0]}";

inline bool has_event(LocalizationPipeline& pipeline, PipelineEvent::Level level, const std::string& text) {
  for (const PipelineEvent& event : pipeline.take_events()) {
    if (event.level == level && event.text.find(text) != std::string::npos) return true;
  }
  return false;
}

}  // namespace urban_gnss
