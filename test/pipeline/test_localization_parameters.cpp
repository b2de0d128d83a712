#include "pipeline_rig.hpp"
#include "urban_gnss_localization/localizers/nishida/particle_filter.hpp"
#include "urban_gnss_localization/localizers/switching/imm_ekf.hpp"
#include "urban_gnss_localization/localizers/switching/switching_particle_filter.hpp"

namespace urban_gnss {
namespace {

/// What users see of half a minute in which everything happens that a parameter is about.
std::string trace(const std::string& base, const std::string& change, bool wants_bias = false) {
  LocalizationParameters parameters = with(with(LocalizationParameters{}, base), change);
  auto localizer = std::make_unique<FakeLocalizer>();
  localizer->wants = wants_bias;
  Rig rig(parameters, std::move(localizer));
  std::ostringstream out;
  const auto note = [&] {
    for (const auto& o : rig.pipeline.take_outputs()) out << o.stamp.count() << ' ' << o.estimate.pose.yaw << '\n';
    for (const auto& v : rig.pipeline.take_outcomes()) out << int(v.decision) << v.covariance_clamped << '\n';
    const LocalizationReport report = rig.pipeline.report();
    out << int(report.state) << report.healthy << report.heading_converged << ' ' << report.fixes_rejected << '\n';
  };
  RandomEngine noise = make_engine(1);
  for (int k = 0; k <= 400; ++k) {
    const double time = 0.1 * k;
    rig.pipeline.add_imu_yaw_rate(Rig::at(time), 0.12);
    rig.pipeline.add_imu_heading({Rig::at(time), Rig::truth(time).yaw + 0.01, 0.02});
    if (k > 200) {
      RawVelocity velocity = Rig::velocity(time);
      if (k % 2 == 0) velocity.covariance.setZero();
      rig.pipeline.add_velocity(velocity);
    }
    if (k % 10 == 0 && k != 150 && (k < 160 || k > 190)) {
      const Eigen::Vector2d error(0.5 * draw_normal(noise), 0.5 * draw_normal(noise));
      RawFix fix = raw_fix(Rig::at(time), Rig::truth(time).position() + error, k % 20 == 0 ? 0.1 : 1.0);
      if (k % 30 == 0) fix.covariance_type = CovarianceType::kUnknown;
      if (k == 270) fix = raw_fix(Rig::at(time), {3000.0, 0.0});
      if (k == 280) fix.covariance *= 1e6;
      rig.pipeline.add_fix(fix);
    }
    if (k == 30 || k == 350) rig.pipeline.add_satellites(Rig::at(time), {});  // the next fix has none
    if (k < 300 || k > 315) rig.drive(time);
    for (const double late_s : {0.7, 0.65, 0.6}) {
      if (k == 350) rig.drive(time - late_s);  // late, and not a clock that was set back
    }
    note();
  }
  for (const FixMeasurement& fix : rig.fake->fixes) {
    out << fix.antenna_in_body.transpose() << ' ' << fix.covariance(0, 0) << ' ' << fix.position.transpose() << '\n';
  }
  for (const HeadingMeasurement& heading : rig.fake->headings)
    out << heading.yaw_rad << ' ' << heading.sigma_rad << '\n';
  for (const VelocityMeasurement& velocity : rig.fake->velocities) out << velocity.covariance(0, 0) << '\n';
  for (const PoseEstimate& start : rig.fake->starts) out << start.pose.x << ' ' << start.covariance << '\n';
  rig.run(0.0, 1.0);
  note();
  return out.str();
}

/// An estimate that goes 40 m off at 10 s, a glitch of the speed at 70 s, and a dead encoder from 80 s on.
std::string trace_of_faults(const std::string& changes) {
  Rig rig(with(with(LocalizationParameters{}, "{datum: [33.0, 130.0, 20.0], initial_pose: [0.0, 0.0, 0.0]}"), changes),
          std::make_unique<FakeLocalizer>());
  SatelliteObservation satellite;
  satellite.id = {Constellation::kGps, 7};
  satellite.look = {1.0, 1.0};
  satellite.cn0_dbhz = 45.0;
  satellite.residual_m = 1.0;
  std::ostringstream out;
  for (int k = 0; k <= 900; ++k) {
    const double time = 0.1 * k;
    if (k % 10 == 0) rig.pipeline.add_satellites(Rig::at(time), {satellite});
    if (k % 10 == 0) rig.fix(time);
    if (k % 10 == 0) rig.pipeline.add_velocity(Rig::velocity(time));
    OdometrySample sample = Rig::odometry(time);
    if (k == 100) rig.fake->state.pose.y += 40.0;
    if (k == 700) sample.twist.speed_mps = 100.0;
    if (k > 800) {
      const Pose2 there = Rig::odometry(80.0).pose;
      sample.twist.speed_mps = 0.0;
      sample.pose = {there.x, there.y, sample.pose.yaw};
    }
    rig.pipeline.add_odometry(sample);
    const LocalizationReport report = rig.pipeline.report();
    out << report.healthy << report.position_sigma_m << ' ' << rig.fake->state.pose.x << '\n';
  }
  return out.str();
}

TEST(LocalizationPipeline, EveryParameterHasAnEffect) {
  const std::string datum = "datum: [33.0, 130.0, 20.0]";
  const std::string given = kGiven;
  const std::string absolute = "{datum: [33.0, 130.0, 20.0], initial_pose: [0.0, 0.0, 0.0], imu_heading: absolute}";
  const std::string far_off = "{datum: [33.0, 130.0, 20.0], initial_pose: [150.0, 0.0, 0.0]}";
  const std::map<std::string, std::pair<std::string, std::string>> changes = {
      {"initial_pose", {datum, "[0.0, 0.0, 0.5]"}},
      {"initial_position_sigma", {given, "2.0"}},
      {"initial_heading_sigma", {given, "0.1"}},
      {"antenna_offset", {given, "[1.0, 0.0]"}},
      {"use_imu_yaw_rate", {given, "false"}},
      {"imu_heading", {absolute, "none"}},
      {"imu_heading_offset", {absolute, "0.1"}},
      {"imu_heading_sigma", {absolute, "0.5"}},
      {"use_gps_velocity", {given, "false"}},
      {"velocity_sigma_default", {given, "0.5"}},
      {"velocity_sigma_floor", {given, "0.2"}},
      {"odometry_gap", {given, "1.0"}},
      {"max_bias_radius", {far_off, "200.0"}},
      {"lost_timeout", {far_off, "5.0"}},
      {"fix_timeout", {given, "3.0"}},
      {"fix_delay", {given, "0.3"}},
      {"bias_timeout", {given, "0.2"}},
      {"satellites_wait", {given, "0.2"}},
      {"time_jump", {given, "0.5"}},
      {"reset_on_time_jump", {given, "false"}},
      {"heading_converged_sigma", {given, "0.1"}},
      {"datum", {"{}", "[33.0, 130.0, 20.0]"}},
      {"datum_fix_count", {"{}", "3"}},
      {"datum_max_spread", {"{}", "2.0"}},
      {"fix_sigma_default", {given, "7.0"}},
      {"fix_sigma_floor", {given, "0.5"}},
      {"fix_sigma_ceiling", {given, "100.0"}},
      {"fix_covariance_scale", {given, "4.0"}},
      {"max_distance_from_datum", {given, "1000.0"}},
      {"initialization_heading_sigma", {datum, "0.05"}},
      {"initialization_timeout", {datum, "2.0"}},
      {"initialization_window", {datum, "2.0"}},
      {"initialization_heading_walk", {datum, "0.2"}},
      {"correlation_distance", {datum, "1.0"}},
      {"correlation_time", {datum, "1.0"}},
  };
  const std::map<std::string, std::string> of_faults = {
      {"max_acceleration", "1.0e+4"}, {"check_wheels", "false"},         {"integrity_window", "16.0"},
      {"integrity_limit", "100.0"},   {"contradiction_patience", "2.0"}, {"residual_limit", "0.5"},
      {"doubt_time", "5.0"},
  };
  for (const auto& [name, value] : of_faults) {
    EXPECT_NE(trace_of_faults(name + ": " + value), trace_of_faults("{}")) << name;
  }
  for (const std::string& name : parameter_names(LocalizationParameters{})) {
    if (of_faults.count(name) > 0) continue;
    if (name == "residual_misfit_limit") continue;  // SatellitesOfFixes.ResidualsOfAnotherPositionAreLeftOut
    if (name.rfind("inert_", 0) == 0) continue;     // InertGate.FalseAlarmsComeAtTheirRateAndEveryParameterHasAnEffect
    const auto found = changes.find(name);
    ASSERT_NE(found, changes.end()) << name << " is not examined";
    const auto& [base, value] = found->second;
    const bool wants_bias = name == "bias_timeout";
    EXPECT_NE(trace(base, name + ": " + value, wants_bias), trace(base, "{}", wants_bias)) << name;
  }
}

}  // namespace
}  // namespace urban_gnss
