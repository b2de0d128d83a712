// What the pipeline makes of the receiver's velocity and the IMU's yaw rate.

#include "pipeline_rig.hpp"

namespace urban_gnss {
namespace {

using Level = PipelineEvent::Level;

/// With the true heading, the odometry's velocity of the antenna is the measured one.
void expect_explained(const VelocityMeasurement& measurement, const Pose2& base_now) {
  const Eigen::Vector2d predicted = transform_point({0.0, 0.0, base_now.yaw}, measurement.antenna_velocity_in_body);
  EXPECT_LT((predicted - measurement.velocity).norm(), 1e-9);
}

TEST(LocalizationMotion, VelocityWaitsForTheOdometryOfItsStamp) {
  Rig rig(kGiven);
  rig.drive(0.0);
  rig.drive(0.9);
  rig.pipeline.add_velocity(Rig::velocity(1.0));
  rig.drive(0.95);
  EXPECT_TRUE(rig.fake->velocities.empty());
  rig.drive(1.1);
  ASSERT_EQ(rig.fake->velocities.size(), 1u);
  expect_explained(rig.fake->velocities[0], Rig::truth(1.1));
  EXPECT_EQ(rig.pipeline.report().velocities_used, 1u);
}

TEST(LocalizationMotion, LateVelocityIsComparedWithTheHeadingAtItsOwnStamp) {
  Rig rig(kGiven);
  rig.pipeline.set_antenna_offset({0.7, -0.4});
  for (int k = 0; k <= 40; ++k) rig.drive(0.1 * k);
  for (const double time : {0.0, 1.0, 2.137, 3.95, 4.0}) {
    rig.pipeline.add_velocity(Rig::velocity(time, {0.7, -0.4}));
    expect_explained(rig.fake->velocities.back(), Rig::truth(4.0));
  }
  EXPECT_EQ(rig.fake->velocities.size(), 5u);
}

TEST(LocalizationMotion, CovarianceIsTheDeclaredOrTheDefault) {
  Rig rig(
      "{datum: [33.0, 130.0, 20.0], initial_pose: [0.0, 0.0, 0.0], velocity_sigma_floor: 0.3, "
      "velocity_sigma_default: 0.7}");
  rig.run(0.0, 1.0, false);
  RawVelocity velocity = Rig::velocity(0.1);
  velocity.covariance = isotropic(0.4);
  rig.pipeline.add_velocity(velocity);
  EXPECT_LT((rig.fake->velocities.back().covariance - isotropic(0.5)).norm(), 1e-12);
  int k = 1;
  for (const double bad : {0.0, -1.0, kNaN, kInfinity}) {
    velocity.stamp = Rig::at(0.1 * ++k);
    velocity.covariance = bad * Eigen::Matrix2d::Identity();
    rig.pipeline.add_velocity(velocity);
    EXPECT_LT((rig.fake->velocities.back().covariance - isotropic(0.7)).norm(), 1e-12) << bad;
  }
}

TEST(LocalizationMotion, VelocityThatCannotBeUsedIsLeftOutWithAnEvent) {
  Rig rig(kGiven);
  rig.run(0.0, 20.0, false);
  rig.pipeline.add_velocity(Rig::velocity(19.0));
  rig.pipeline.take_events();
  for (const double bad : {kNaN, kInfinity, -kInfinity, 1e300, 200.0}) {
    for (int axis = 0; axis < 2; ++axis) {
      RawVelocity velocity = Rig::velocity(19.5);
      velocity.velocity[axis] = bad;
      rig.pipeline.add_velocity(velocity);
      EXPECT_TRUE(has_event(rig.pipeline, Level::kWarn,
                            std::isfinite(bad) ? "velocity of the receiver left out: beyond 150 m/s"
                                               : "velocity of the receiver left out: not finite"))
          << bad;
    }
  }
  rig.pipeline.add_velocity(Rig::velocity(30.5));
  EXPECT_TRUE(has_event(rig.pipeline, Level::kWarn, "ahead of the odometry"));
  rig.pipeline.add_velocity(Rig::velocity(19.0));
  EXPECT_TRUE(has_event(rig.pipeline, Level::kWarn, "not newer than the last"));
  rig.pipeline.add_velocity(Rig::velocity(18.5));
  EXPECT_TRUE(has_event(rig.pipeline, Level::kWarn, "not newer than the last"));
  EXPECT_EQ(rig.fake->velocities.size(), 1u);
  rig.pipeline.add_velocity(Rig::velocity(19.5));
  EXPECT_EQ(rig.fake->velocities.size(), 2u);

  Rig early(kGiven);
  early.run(12.0, 30.0, false);
  early.pipeline.take_events();
  early.pipeline.add_velocity(Rig::velocity(15.0));
  EXPECT_TRUE(has_event(early.pipeline, Level::kWarn, "older than the odometry"));
  EXPECT_TRUE(early.fake->velocities.empty());
}

TEST(LocalizationMotion, VelocitiesAreTheSameAfterAClockThatWasSetBack) {
  Rig rig(kGiven);
  std::size_t used[2];
  for (std::size_t& count : used) {
    for (int k = 0; k <= 100; ++k) {
      rig.pipeline.add_velocity(Rig::velocity(0.1 * k));
      rig.drive(0.1 * k);
    }
    count = rig.pipeline.report().velocities_used;
  }
  EXPECT_TRUE(has_event(rig.pipeline, Level::kWarn, "jumped back"));
  EXPECT_EQ(used[0], 101u);
  // The one that showed the jump went before the odometry that begins anew: it is used, too.
  EXPECT_EQ(used[1], 101u);
}

TEST(LocalizationMotion, VelocitiesAreForThoseWhoWantThem) {
  for (const bool use : {true, false}) {
    for (const bool takes : {true, false}) {
      Rig rig(
          std::string(
              "{datum: [33.0, 130.0, 20.0], initial_pose: [0.0, 0.0, 0.0], check_wheels: false, use_gps_velocity: ") +
          (use ? "true}" : "false}"));
      rig.fake->takes = takes;
      rig.run(0.0, 1.0, false);
      RawVelocity bad = Rig::velocity(0.3);
      bad.velocity.x() = kNaN;
      rig.pipeline.take_events();
      rig.pipeline.add_velocity(bad);
      rig.pipeline.add_velocity(Rig::velocity(0.5));
      EXPECT_EQ(rig.pipeline.takes_velocity(), use && takes);
      EXPECT_EQ(rig.fake->velocities.size(), use && takes ? 1u : 0u);
      EXPECT_EQ(rig.pipeline.take_events().empty(), !(use && takes));
    }
  }
}

/// s until it has started from fixes of 5 m.
double start_time(bool with_velocities, double& yaw_error) {
  Rig rig("datum: [33.0, 130.0, 20.0]");
  RandomEngine engine = make_engine(6);
  for (int k = 0; k <= 600; ++k) {
    const double time = 0.1 * k;
    if (k % 10 == 0) {
      const Eigen::Vector2d error(5.0 * draw_normal(engine), 5.0 * draw_normal(engine));
      rig.pipeline.add_fix(raw_fix(Rig::at(time), Rig::truth(time).position() + error, 5.0));
      if (with_velocities) rig.pipeline.add_velocity(Rig::velocity(time));
    }
    rig.drive(time);
    if (!rig.pipeline.initialized()) continue;
    yaw_error = std::abs(angle_difference(rig.fake->starts[0].pose.yaw, Rig::truth(time).yaw));
    return time;
  }
  return kInfinity;
}

// Wheels are checked beside any localizer.
TEST(LocalizationMotion, VelocitiesTellOfTheWheelsWhereTheLocalizerDoesNotTakeThem) {
  Rig rig("{datum: [33.0, 130.0, 20.0], initial_pose: [0.0, 0.0, 0.0]}");
  rig.fake->takes = false;
  EXPECT_TRUE(rig.pipeline.takes_velocity());
  for (int k = 0; k <= 100; ++k) {
    OdometrySample sample = Rig::odometry(0.1 * k);
    sample.twist.speed_mps = 0.0;
    rig.pipeline.add_odometry(sample);
    if (k % 10 == 0) rig.fix(0.1 * k);
    if (k % 10 == 0) rig.pipeline.add_velocity(Rig::velocity(0.1 * k));
  }
  EXPECT_TRUE(rig.fake->velocities.empty());
  EXPECT_GT(rig.fake->moves.back().first.speed_mps, 1.5) << "the receiver's";
  EXPECT_GT(rig.fake->doubted.position_m2, 0.0);
}

// A receiver behind a driver that publishes no velocity: its fixes see the wheels stand, too.
TEST(LocalizationMotion, FixesTellOfTheWheelsWhereThereIsNoVelocity) {
  for (const bool has_velocity : {false, true}) {
    Rig rig("{datum: [33.0, 130.0, 20.0], initial_pose: [0.0, 0.0, 0.0], initial_heading_sigma: 0.1}");
    for (int k = 0; k <= 200; ++k) {
      OdometrySample sample = Rig::odometry(0.1 * k);
      sample.has_pose = false;
      if (k > 100) sample.twist.speed_mps = 0.0;
      rig.pipeline.add_odometry(sample);
      if (k % 10 != 0) continue;
      if (has_velocity) {  // and believes the wheels, whatever the fixes say
        RawVelocity velocity = Rig::velocity(0.1 * k);
        if (k > 100) velocity.velocity.setZero();
        rig.pipeline.add_velocity(velocity);
      }
      rig.fix(0.1 * k);
    }
    EXPECT_EQ(rig.fake->moves.back().first.speed_mps > 1.5, !has_velocity);
    EXPECT_EQ(rig.fake->doubted.position_m2 > 0.0, !has_velocity);
  }
}

TEST(LocalizationMotion, VelocitiesTellTheHeadingWithinSeconds) {
  double with_error = kNaN;
  double without_error = kNaN;
  EXPECT_LT(start_time(true, with_error), 5.0);
  EXPECT_LT(with_error, 0.05);
  EXPECT_GT(start_time(false, without_error), 10.0);
}

TEST(LocalizationMotion, ImuYawRateReplacesTheOdometrys) {
  for (const bool use : {false, true}) {
    Rig rig(std::string("{datum: [33.0, 130.0, 20.0], initial_pose: [0.0, 0.0, 0.0], use_imu_yaw_rate: ") +
            (use ? "true}" : "false}"));
    rig.drive(0.0);
    rig.pipeline.add_imu_yaw_rate(Rig::at(0.0), 0.7);  // belongs to the step before
    rig.pipeline.add_imu_yaw_rate(Rig::at(0.02), 0.2);
    rig.pipeline.add_imu_yaw_rate(Rig::at(0.06), 0.3);
    rig.pipeline.add_imu_yaw_rate(Rig::at(0.12), 0.4);  // belongs to the step after
    rig.drive(0.1);
    EXPECT_NEAR(rig.fake->moves[0].first.yaw_rate_radps, use ? 0.25 : 0.1, 1e-12);
    EXPECT_EQ(rig.fake->moves[0].first.speed_mps, 2.0);
    rig.drive(0.2);
    EXPECT_NEAR(rig.fake->moves[1].first.yaw_rate_radps, use ? 0.4 : 0.1, 1e-12);
    rig.drive(0.3);  // none came: a moment before is near enough
    EXPECT_NEAR(rig.fake->moves[2].first.yaw_rate_radps, use ? 0.4 : 0.1, 1e-12);
    rig.drive(0.4);  // and now too long ago
    rig.drive(0.5);
    EXPECT_NEAR(rig.fake->moves[4].first.yaw_rate_radps, 0.1, 1e-12);
  }
}

TEST(LocalizationMotion, SilentImuFallsBackToTheOdometryAndIsSaidOnce) {
  Rig rig(kGiven);
  int warnings = 0;
  int infos = 0;
  for (int k = 0; k <= 200; ++k) {
    if (k < 50 || k > 150) rig.pipeline.add_imu_yaw_rate(Rig::at(0.1 * k), 0.3);
    rig.drive(0.1 * k);
    for (const PipelineEvent& event : rig.pipeline.take_events()) {
      warnings += event.text.find("the IMU is silent") != std::string::npos;
      infos += event.text.find("the IMU's yaw rate is used") != std::string::npos;
    }
  }
  EXPECT_EQ(warnings, 1);
  EXPECT_EQ(infos, 2);  // at the start, and when it came back
  EXPECT_EQ(rig.fake->moves[40].first.yaw_rate_radps, 0.3);
  EXPECT_EQ(rig.fake->moves[100].first.yaw_rate_radps, Rig::kTwist.yaw_rate_radps);
  EXPECT_EQ(rig.fake->moves[180].first.yaw_rate_radps, 0.3);
}

TEST(LocalizationMotion, ImuThatIsSlowerThanTheOdometryIsOneSource) {
  Rig rig(kGiven);
  for (int k = 0; k <= 100; ++k) {
    if (k % 5 == 0) rig.pipeline.add_imu_yaw_rate(Rig::at(0.02 * k), 0.3);  // 10 Hz beside 50 Hz
    rig.drive(0.02 * k);
  }
  for (const auto& [twist, duration_s] : rig.fake->moves) EXPECT_EQ(twist.yaw_rate_radps, 0.3);
}

TEST(LocalizationMotion, YawRateFromTheFutureIsLeftOut) {
  Rig rig(kGiven);
  rig.drive(0.0);
  rig.pipeline.add_imu_yaw_rate(Rig::at(3600.0), 0.3);
  EXPECT_TRUE(has_event(rig.pipeline, Level::kWarn, "yaw rate of the IMU left out"));
  rig.pipeline.add_imu_yaw_rate(Rig::at(0.1), 0.2);  // not taken for a clock that was set back
  rig.drive(0.1);
  EXPECT_EQ(rig.fake->moves.at(0).first.yaw_rate_radps, 0.2);
}

TEST(LocalizationMotion, ImuThatContradictsTheOdometryIsSaidOnce) {
  for (const auto& [factor, warnings] : {std::pair{1.0, 0}, {-1.0, 1}, {57.3, 1}, {0.4, 0}}) {
    Rig rig(kGiven);
    int count = 0;
    for (int k = 0; k <= 2000; ++k) {
      rig.pipeline.add_imu_yaw_rate(Rig::at(0.1 * k), factor * Rig::kTwist.yaw_rate_radps);
      rig.drive(0.1 * k);
      for (const PipelineEvent& event : rig.pipeline.take_events()) {
        count += event.text.find("times the odometry's") != std::string::npos;
      }
    }
    EXPECT_EQ(count, warnings) << factor;
  }
}

TEST(LocalizationMotion, VelocityIsTurnedByTheConvergenceOfTheMeridians) {
  const GeodeticPosition robot{65.0, 21.91, 0.0};
  const LocalFrame map({65.0, 20.0, 0.0});
  LocalizationParameters parameters;
  parameters.datum.datum = {65.0, 20.0, 0.0};
  auto owned = std::make_unique<FakeLocalizer>();
  FakeLocalizer& fake = *owned;
  LocalizationPipeline pipeline(parameters, std::move(owned));
  const Eigen::Vector3d place = map.to_local(robot);
  pipeline.set_pose({{place.x(), place.y(), 0.0}, 0.01 * Eigen::Matrix3d::Identity()});
  RawFix fix;
  fix.has_fix = true;
  fix.position = robot;
  fix.covariance = Eigen::Matrix3d::Identity();
  fix.covariance_type = CovarianceType::kKnown;
  for (int k = 0; k <= 20; ++k) {
    const Stamp stamp = Rig::at(0.1 * k);
    pipeline.add_odometry({stamp, {0.2 * k, 0.0, 0.0}, {2.0, 0.0}});
    if (k == 5) {
      fix.stamp = stamp;
      pipeline.add_fix(fix);
    }
    RawVelocity east{stamp, {2.0, 0.0}, 0.01 * Eigen::Matrix2d::Identity()};
    if (k == 10) pipeline.add_velocity(east);
  }
  ASSERT_EQ(fake.velocities.size(), 1u);
  const Eigen::Vector2d& measured = fake.velocities[0].velocity;
  EXPECT_NEAR(measured.norm(), 2.0, 1e-9);
  EXPECT_NEAR(std::atan2(measured.y(), measured.x()), map.convergence_rad(robot), 1e-9);
  EXPECT_GT(std::atan2(measured.y(), measured.x()), 0.029);
}

TEST(LocalizationMotion, StampsOfAnotherClockAreNamed) {
  Rig rig(kGiven);
  for (int k = 0; k <= 200; ++k) {
    rig.drive(0.1 * k);
    rig.pipeline.add_imu_yaw_rate(Rig::at(0.1 * k + 3600.0), 0.3);
    if (k % 10 == 0) rig.pipeline.add_fix(raw_fix(Rig::at(0.1 * k + 18.0), {0.0, 0.0}));
  }
  int imu = 0;
  int fixes = 0;
  for (const PipelineEvent& event : rig.pipeline.take_events()) {
    imu += event.text.find("stamps of IMU are 3599.9 s ahead") != std::string::npos;
    fixes += event.text.find("GPS time in place of UTC") != std::string::npos;
  }
  EXPECT_EQ(imu, 1);
  EXPECT_EQ(fixes, 1);
  const auto outcomes = rig.pipeline.take_outcomes();
  ASSERT_EQ(outcomes.size(), 21u);
  for (const FixOutcome& outcome : outcomes) EXPECT_EQ(outcome.decision, FixDecision::kRejectedStale);
  EXPECT_NE(outcomes.back().reason.find("GPS time"), std::string::npos) << outcomes.back().reason;
}

// Upside down, and tf says so; NED, which its accelerometer tells; and what nothing tells but the wheels.
TEST(LocalizationMotion, YawRateIsThatOfTheRobotHoweverTheImuIsMounted) {
  const Eigen::Quaterniond upside_down(Eigen::AngleAxisd(kPi, Eigen::Vector3d::UnitX()));
  for (const auto& [told, gravity] : {std::pair{true, false}, {false, true}, {false, false}}) {
    Rig rig(kGiven);
    if (told) rig.pipeline.set_imu_mounting(upside_down);
    for (int k = 0; k <= 400; ++k) {
      ImuSample sample;
      sample.stamp = Rig::at(0.1 * k);
      sample.rate_radps = {0.0, 0.0, -Rig::kTwist.yaw_rate_radps - 0.001};
      if (gravity) sample.acceleration_mps2 = {0.0, 0.0, -9.81};
      rig.pipeline.add_imu(sample);
      rig.drive(0.1 * k);
    }
    const double used_radps = rig.fake->moves.back().first.yaw_rate_radps;
    EXPECT_NEAR(used_radps, Rig::kTwist.yaw_rate_radps + (told || gravity ? 0.001 : 0.0), 1e-9);
    EXPECT_EQ(has_event(rig.pipeline, Level::kWarn, "times the odometry's"), !told);
    EXPECT_EQ(rig.fake->doubted.heading_rad2 > 0.9, !told);
  }
}

TEST(LocalizationMotion, OneFalseRateOfTheGyroscopeIsLeftOutAndSaid) {
  for (const double odometry_hz : {10.0, 50.0}) {
    for (const double amplitude : {3.0, -8.0, 30.0, 200.0}) {
      Rig rig(kGiven);
      const int every = static_cast<int>(50.0 / odometry_hz);
      for (int k = 0; k <= 1000; ++k) {
        rig.pipeline.add_imu_yaw_rate(Rig::at(0.02 * k), k == 503 ? amplitude : 0.1);
        if (k % every == 0) rig.drive(0.02 * k);
      }
      for (const auto& [twist, duration_s] : rig.fake->moves) ASSERT_NEAR(twist.yaw_rate_radps, 0.1, 1e-9);
      EXPECT_TRUE(has_event(rig.pipeline, Level::kWarn, "far from its neighbours")) << amplitude;
    }
  }
}

TEST(LocalizationMotion, ATwistOfZeroBesideAPoseThatMovesIsReplaced) {
  Rig rig(kGiven);
  for (int k = 0; k <= 300; ++k) {
    OdometrySample sample = Rig::odometry(0.1 * k);
    sample.twist = {};
    if (k % 10 == 0) rig.fix(0.1 * k);
    rig.pipeline.add_odometry(sample);
  }
  EXPECT_TRUE(has_event(rig.pipeline, Level::kWarn, "the twist is not filled in"));
  EXPECT_NEAR(rig.fake->moves.back().first.speed_mps, 2.0, 1e-6);
  EXPECT_NEAR(rig.fake->moves.back().first.yaw_rate_radps, 0.1, 1e-6);
  EXPECT_GT(rig.fake->doubted.position_m2, 0.0) << "what was lost until then";
  EXPECT_TRUE(rig.pipeline.report().healthy) << rig.pipeline.report().reason;
}

/// What the localizer is told where the receiver's velocity contradicts the wheels, where the pose moves and the twist
/// does not, or where the IMU turns the other way.
MotionDoubt doubt_of(const std::string& fault, bool printed) {
  Rig rig(kGiven);
  rig.fake->printed = printed;
  for (int k = 0; k <= 400; ++k) {
    OdometrySample sample = Rig::odometry(0.1 * k);
    if (fault == "wheels") sample.twist.speed_mps = 0.0;
    if (fault == "twist") sample.twist = {};
    if (fault == "imu") rig.pipeline.add_imu_yaw_rate(sample.stamp, -Rig::kTwist.yaw_rate_radps);
    rig.pipeline.add_odometry(sample);
    if (k % 10 != 0) continue;
    rig.fix(0.1 * k);
    if (fault == "wheels") rig.pipeline.add_velocity(Rig::velocity(0.1 * k));
  }
  return rig.fake->doubted;
}

TEST(LocalizationMotion, AsPrintedIsToldNoDoubt) {
  for (const char* fault : {"wheels", "twist", "imu"}) {
    EXPECT_TRUE(doubt_of(fault, false).exists()) << fault;
    EXPECT_FALSE(doubt_of(fault, true).exists()) << fault;
  }
}

TEST(LocalizationMotion, AContradictionThatNothingResolvesIsNotHealthy) {
  Rig rig(kGiven);
  for (int k = 0; k <= 300; ++k) {
    OdometrySample sample = Rig::odometry(0.1 * k);
    sample.twist.speed_mps *= 3.6;
    rig.pipeline.add_odometry(sample);
    if (k < 200 && k % 50 == 0) rig.fix(0.1 * k);
  }
  EXPECT_TRUE(has_event(rig.pipeline, Level::kWarn, "km/h"));
  EXPECT_FALSE(rig.pipeline.report().healthy);
  EXPECT_NEAR(rig.fake->moves.back().first.speed_mps, 2.0, 1e-6) << "the pose's, meanwhile";
}

}  // namespace
}  // namespace urban_gnss
