#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "urban_gnss_localization/simulation/wheel_odometry.hpp"

namespace urban_gnss {
namespace {

constexpr double kWheelbase_m = 2.5;
constexpr double kStep_s = 0.01;
constexpr Drive kDrives[] = {Drive::kBicycle, Drive::kDifferential};

WheelOdometryParameters perfect() {
  WheelOdometryParameters parameters;
  parameters.speed_scale_sigma = parameters.yaw_rate_scale_sigma = 0.0;
  parameters.yaw_rate_bias_sigma = parameters.yaw_rate_bias_walk = 0.0;
  parameters.speed_noise_density = parameters.yaw_rate_noise_density = 0.0;
  parameters.tick = parameters.steering_resolution = 0.0;
  parameters.slip_interval = 0.0;
  return parameters;
}

std::vector<WheelOdometryMessage> drive(WheelOdometry& odometry, const Twist2& twist, double duration_s,
                                        double step_s = kStep_s) {
  std::vector<WheelOdometryMessage> messages;
  for (int i = 0; i < std::lround(duration_s / step_s); ++i) {
    if (const auto message = odometry.advance(twist, step_s)) messages.push_back(*message);
  }
  return messages;
}

TEST(WheelOdometry, WithoutErrorsItIsTheTruth) {
  for (const Drive kind : kDrives) {
    WheelOdometry odometry(perfect(), kind, kWheelbase_m, 1);
    Pose2 truth;
    std::optional<WheelOdometryMessage> last;
    for (int i = 0; i < 2000; ++i) {
      const Twist2 twist{5.0 + 3.0 * std::sin(0.001 * i), 0.4 * std::cos(0.002 * (i / 2))};
      truth = move(truth, twist, kStep_s);
      if (const auto message = odometry.advance(twist, kStep_s)) last = message;
    }
    ASSERT_TRUE(last);
    EXPECT_NEAR(last->stamp_s, 20.0, 1e-12);
    EXPECT_NEAR(last->pose.x, truth.x, 1e-3);  // two steps of a slightly different twist make one message
    EXPECT_NEAR(last->pose.y, truth.y, 1e-3);
    EXPECT_NEAR(angle_difference(last->pose.yaw, truth.yaw), 0.0, 1e-9);
    EXPECT_EQ(last->speed_variance, 0.0);
  }
}

TEST(WheelOdometry, MessagesAreOnTimeWhateverTheStep) {
  for (const double rate : {50.0, 64.0, 200.0}) {
    for (const double step : {0.001, 0.003, 0.005}) {
      WheelOdometryParameters parameters = perfect();
      parameters.rate = rate;
      WheelOdometry odometry(parameters, Drive::kBicycle, kWheelbase_m, 1);
      const auto messages = drive(odometry, {6.0, 0.2}, 3.0, step);
      ASSERT_EQ(messages.size(), static_cast<std::size_t>(3.0 * rate));
      for (std::size_t i = 0; i < messages.size(); ++i) {
        ASSERT_NEAR(messages[i].stamp_s, static_cast<double>(i + 1) / rate, 1e-12);
        ASSERT_NEAR(messages[i].twist.speed_mps, 6.0, 1e-5);
      }
    }
  }
}

TEST(WheelOdometry, LongStepIntegratesAllItsMessages) {
  WheelOdometry odometry(perfect(), Drive::kBicycle, kWheelbase_m, 1);
  const auto message = odometry.advance({2.0, 0.0}, 1.0);
  ASSERT_TRUE(message);
  EXPECT_NEAR(message->stamp_s, 1.0, 1e-12);
  EXPECT_NEAR(message->pose.x, 2.0, 1e-9);
}

TEST(WheelOdometry, ScaleAndBiasAreWhatTheySay) {
  for (const Drive kind : kDrives) {
    WheelOdometryParameters parameters = perfect();
    parameters.speed_scale_sigma = 0.02;
    parameters.yaw_rate_scale_sigma = 0.05;
    parameters.yaw_rate_bias_sigma = 0.01;
    WheelOdometry odometry(parameters, kind, kWheelbase_m, 11);
    const auto messages = drive(odometry, {8.0, 0.3}, 1.0);
    EXPECT_NE(odometry.speed_scale(), 1.0);
    EXPECT_NEAR(messages.back().twist.speed_mps, 8.0 * odometry.speed_scale(), 1e-9);
    EXPECT_NEAR(messages.back().twist.yaw_rate_radps, 0.3 * odometry.yaw_rate_scale() + odometry.yaw_rate_bias_radps(),
                1e-9);
  }
}

TEST(WheelOdometry, StandingRobotTurnsNoWheel) {
  WheelOdometryParameters parameters;
  parameters.yaw_rate_wander_sigma = parameters.speed_scale_wander_sigma = 0.1;
  for (const Drive kind : kDrives) {
    WheelOdometry odometry(parameters, kind, kWheelbase_m, 3);
    drive(odometry, {5.0, 0.1}, 2.0);
    const Pose2 before = odometry.pose();
    for (const auto& message : drive(odometry, {}, 20.0)) {
      ASSERT_EQ(message.twist.speed_mps, 0.0);
      ASSERT_EQ(message.twist.yaw_rate_radps, 0.0);
      ASSERT_GT(message.speed_variance, 0.0);
      ASSERT_GT(message.yaw_rate_variance, 0.0);
    }
    EXPECT_EQ(odometry.pose().x, before.x);
    EXPECT_EQ(odometry.pose().yaw, before.yaw);
  }
}

TEST(WheelOdometry, TicksAreWholeAndDoNotAddUp) {
  WheelOdometryParameters parameters = perfect();
  parameters.tick = 0.05;
  WheelOdometry odometry(parameters, Drive::kBicycle, kWheelbase_m, 1);
  const double speed = 1.23;
  const auto messages = drive(odometry, {speed, 0.0}, 40.0);
  for (const auto& message : messages) {
    const double ticks = message.twist.speed_mps / 50.0 / 0.05;
    ASSERT_NEAR(ticks, std::round(ticks), 1e-6);
    ASSERT_LT(std::abs(message.pose.x - speed * message.stamp_s), 0.05 + 1e-9);
  }
}

TEST(WheelOdometry, SteeringIsQuantised) {
  WheelOdometryParameters parameters = perfect();
  parameters.steering_resolution = 0.02;
  WheelOdometry odometry(parameters, Drive::kBicycle, kWheelbase_m, 1);
  const Twist2 twist{5.0, yaw_rate({5.0, 0.117}, kWheelbase_m)};
  EXPECT_NEAR(drive(odometry, twist, 0.1).back().twist.yaw_rate_radps, yaw_rate({5.0, 0.12}, kWheelbase_m), 1e-9);
}

TEST(WheelOdometry, SlipHappensAsOftenAndAsMuchAsSaid) {
  for (const Drive kind : kDrives) {
    WheelOdometryParameters parameters = perfect();
    parameters.slip_interval = 4.0;
    parameters.slip_duration = 1.0;
    parameters.slip_share = 0.5;
    WheelOdometry odometry(parameters, kind, kWheelbase_m, 21);
    int left = 0;
    int right = 0;
    int slipping = 0;
    const auto messages = drive(odometry, {6.0, 0.0}, 5000.0);
    const double full = kind == Drive::kBicycle ? 9.0 : 7.5;  // one wheel of two
    for (const auto& message : messages) {
      ASSERT_GE(message.twist.speed_mps, 6.0 - 1e-6);
      ASSERT_LE(message.twist.speed_mps, full + 1e-6);
      slipping += message.twist.speed_mps > 6.1;
      left += message.twist.yaw_rate_radps < -1e-3;
      right += message.twist.yaw_rate_radps > 1e-3;
    }
    // About 1000 slips of 1 s in 5000 s, with exponential gaps: sigma of the share is about 0.2 * 0.8 / sqrt(1000).
    EXPECT_NEAR(static_cast<double>(slipping) / static_cast<double>(messages.size()), 0.2, 0.025);
    if (kind == Drive::kBicycle) {
      EXPECT_EQ(left + right, 0);
    } else {
      EXPECT_NEAR(static_cast<double>(left) / (left + right), 0.5, 0.08);
    }
  }
}

TEST(WheelOdometry, BiasWalks) {
  WheelOdometryParameters parameters = perfect();
  parameters.yaw_rate_bias_walk = 1e-3;
  double squares = 0.0;
  const int seeds = 400;
  for (int seed = 0; seed < seeds; ++seed) {
    WheelOdometry odometry(parameters, Drive::kBicycle, kWheelbase_m, static_cast<std::uint64_t>(seed));
    drive(odometry, {1.0, 0.0}, 25.0, 0.02);
    squares += std::pow(odometry.yaw_rate_bias_radps(), 2);
  }
  EXPECT_NEAR(squares / seeds / (1e-6 * 25.0), 1.0, 5.0 * std::sqrt(2.0 / seeds));
}

/// Variance of the integral over `time_s` of a stationary Gauss-Markov process of this sigma and correlation time.
double integral_variance(double sigma, double correlation_s, double time_s) {
  const double times = time_s / correlation_s;
  return 2.0 * std::pow(sigma * correlation_s, 2) * (times - 1.0 + std::exp(-times));
}

TEST(WheelOdometry, YawRateAndSpeedScaleWander) {
  WheelOdometryParameters parameters = perfect();
  parameters.yaw_rate_wander_sigma = 0.022;
  parameters.yaw_rate_wander_time = 0.6;
  parameters.speed_scale_wander_sigma = 0.05;
  parameters.speed_scale_wander_time = 10.0;
  constexpr double kSpeed_mps = 1.3;
  const std::vector<double> times_s{1.0, 10.0, 30.0};
  for (const Drive kind : kDrives) {
    std::vector<double> yaw_squares(times_s.size());
    std::vector<double> distance_squares(times_s.size());
    const int seeds = 1000;
    for (int seed = 0; seed < seeds; ++seed) {
      WheelOdometry odometry(parameters, kind, kWheelbase_m, static_cast<std::uint64_t>(seed));
      const auto messages = drive(odometry, {kSpeed_mps, 0.0}, 30.0, 0.02);
      double distance_m = 0.0;
      for (std::size_t i = 0, k = 0; i < messages.size(); ++i) {
        distance_m += messages[i].twist.speed_mps / parameters.rate;
        if (messages[i].stamp_s < times_s[k] - 1e-9) continue;
        yaw_squares[k] += std::pow(messages[i].pose.yaw, 2);
        distance_squares[k] += std::pow(distance_m / kSpeed_mps - times_s[k], 2);
        ++k;
      }
    }
    // 5 sigma of a mean of squares of a normal variable.
    const double band = 5.0 * std::sqrt(2.0 / seeds);
    for (std::size_t k = 0; k < times_s.size(); ++k) {
      EXPECT_NEAR(yaw_squares[k] / seeds / integral_variance(0.022, 0.6, times_s[k]), 1.0, band) << times_s[k];
      EXPECT_NEAR(distance_squares[k] / seeds / integral_variance(0.05, 10.0, times_s[k]), 1.0, band) << times_s[k];
    }
  }
}

TEST(WheelOdometry, WanderingLeavesTheOtherNoise) {
  WheelOdometryParameters parameters;
  parameters.tick = 0.0;  // which mixes the errors of speed and yaw rate
  WheelOdometryParameters off = parameters;
  off.yaw_rate_wander_time = off.speed_scale_wander_time = 3.0;
  WheelOdometryParameters wandering = off;
  wandering.yaw_rate_wander_sigma = 0.02;
  const auto measured = [](const WheelOdometryParameters& p) {
    WheelOdometry odometry(p, Drive::kDifferential, 0.0, 8);
    return drive(odometry, {1.3, 0.1}, 300.0);
  };
  const auto usual = measured(parameters);
  const auto without = measured(off);
  const auto with = measured(wandering);
  double largest_radps = 0.0;
  for (std::size_t i = 0; i < usual.size(); ++i) {
    ASSERT_EQ(without[i].twist.speed_mps, usual[i].twist.speed_mps);
    ASSERT_EQ(without[i].twist.yaw_rate_radps, usual[i].twist.yaw_rate_radps);
    ASSERT_EQ(without[i].yaw_rate_variance, usual[i].yaw_rate_variance);
    // What a slipping wheel turns too much is a share of its turn, wandering included.
    ASSERT_NEAR(with[i].twist.speed_mps, usual[i].twist.speed_mps, 0.01);
    largest_radps = std::max(largest_radps, std::abs(with[i].twist.yaw_rate_radps - usual[i].twist.yaw_rate_radps));
  }
  EXPECT_GT(largest_radps, 0.04);
  EXPECT_LT(largest_radps, 0.12) << "six sigma";
}

TEST(WheelOdometry, WheelsMayBeOfAnotherSize) {
  for (const Drive kind : kDrives) {
    WheelOdometryParameters parameters = perfect();
    parameters.speed_scale = 1.07;
    WheelOdometry odometry(parameters, kind, kWheelbase_m, 1);
    const Twist2 twist = drive(odometry, {1.3, 0.2}, 1.0).back().twist;
    EXPECT_NEAR(twist.speed_mps, 1.07 * 1.3, 1e-9);
    EXPECT_NEAR(twist.yaw_rate_radps, 0.2, 1e-9);
  }
}

/// Mean squared error over declared variance at one moment, over many runs: 1 where the variances are honest.
void expect_consistent(const WheelOdometryParameters& parameters, Drive kind, double band) {
  const int seeds = 4000;
  double speed_nees = 0.0;
  double yaw_nees = 0.0;
  RandomEngine engine = make_engine(77);
  for (int seed = 0; seed < seeds; ++seed) {
    WheelOdometry odometry(parameters, kind, kWheelbase_m, static_cast<std::uint64_t>(seed));
    const Twist2 twist{3.0 + 7.0 * draw_uniform(engine), 0.6 * draw_uniform(engine) - 0.3};
    const auto messages = drive(odometry, twist, 1.0, 0.02);
    const auto& message = messages.back();
    speed_nees += std::pow(message.twist.speed_mps - twist.speed_mps, 2) / message.speed_variance;
    yaw_nees += std::pow(message.twist.yaw_rate_radps - twist.yaw_rate_radps, 2) / message.yaw_rate_variance;
  }
  EXPECT_NEAR(speed_nees / seeds, 1.0, band) << enum_name(kind);
  EXPECT_NEAR(yaw_nees / seeds, 1.0, band) << enum_name(kind);
}

TEST(WheelOdometry, VariancesAreHonest) {
  // 5 sigma of a mean of 4000 squares of a normal variable: 5 sqrt(2/4000) = 0.11.
  for (const Drive kind : kDrives) {
    WheelOdometryParameters parameters;
    parameters.slip_interval = 0.0;
    expect_consistent(parameters, kind, 0.11);

    WheelOdometryParameters only_ticks = perfect();
    only_ticks.tick = 0.002;
    only_ticks.steering_resolution = kind == Drive::kBicycle ? 0.01 : 0.0;
    expect_consistent(only_ticks, kind, 0.11);

    WheelOdometryParameters slow = perfect();
    slow.speed_noise_density = 0.02;
    slow.yaw_rate_bias_walk = 0.01;
    slow.yaw_rate_noise_density = 0.001;
    expect_consistent(slow, kind, 0.11);

    WheelOdometryParameters wandering = perfect();
    wandering.speed_scale_wander_sigma = 0.02;
    wandering.yaw_rate_wander_sigma = 0.02;
    expect_consistent(wandering, kind, 0.11);
  }
}

TEST(WheelOdometry, VariancesCoverSlip) {
  WheelOdometryParameters parameters = perfect();
  parameters.slip_interval = 0.4;  // so often that one second reaches the steady state
  parameters.slip_duration = 0.1;
  parameters.slip_share = 0.02;  // the variances are taken at the measured speed, which slip itself raises
  // The squared error over its variance is 5 with probability 0.2, else 0: sigma of the mean 2 / sqrt(4000) = 0.03.
  for (const Drive kind : kDrives) expect_consistent(parameters, kind, 0.2);
}

TEST(WheelOdometry, SeedDecides) {
  const auto end = [](std::uint64_t seed) {
    WheelOdometry odometry({}, Drive::kDifferential, 0.0, seed);
    return drive(odometry, {5.0, 0.2}, 3.0).back().pose.x;
  };
  EXPECT_EQ(end(4), end(4));
  EXPECT_NE(end(4), end(5));
}

}  // namespace
}  // namespace urban_gnss
