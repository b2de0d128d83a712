#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "receiver_rig.hpp"
#include "urban_gnss_localization/gnss/nominal_cn0.hpp"
#include "urban_gnss_localization/gnss/range_fix.hpp"
#include "urban_gnss_localization/simulation/receiver.hpp"

namespace urban_gnss {
namespace {

TEST(Receiver, WithoutNoiseTheFixIsTheTruth) {
  Receiver receiver(without_noise(), 1);
  for (int i = 0; i < 20; ++i) {
    const Eigen::Vector3d antenna(2.0 * i, 3.0, 1.5);
    const ReceiverEpoch epoch = receiver.epoch(kEpoch, antenna, {10.0, 0.0, 0.0}, open_sky());
    ASSERT_TRUE(epoch.fix);
    EXPECT_LT((epoch.fix->position - antenna).norm(), 0.02);
    EXPECT_EQ(epoch.fix->velocity, Eigen::Vector3d(10.0, 0.0, 0.0));
    EXPECT_EQ(epoch.used_count, 14);
  }
}

TEST(Receiver, ClaimsUereTimesDilutionWhateverHappens) {
  ReceiverParameters parameters = without_noise();
  parameters.uere = 4.0;
  Receiver receiver(parameters, 1);
  auto sky = open_sky();
  for (ReceivedSatellite& s : sky) {
    s.paths.is_blocked = true;
    s.paths.has_direct = false;
    s.paths.reflections = {reflection(s.line_of_sight.x() > 0.0 ? 10.0 : 150.0, 9.0)};
  }
  const ReceiverEpoch epoch = receiver.epoch(kEpoch, Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero(), sky);
  ASSERT_TRUE(epoch.fix);
  EXPECT_NEAR(epoch.fix->covariance(0, 0), std::pow(4.0 * epoch.hdop, 2), 1e-9);
  EXPECT_NEAR(epoch.fix->covariance(1, 1), std::pow(4.0 * epoch.hdop, 2), 1e-9);
  EXPECT_EQ(epoch.fix->covariance(0, 1), 0.0);
  EXPECT_GT(epoch.fix->position.head<2>().norm(), 3.0 * std::sqrt(epoch.fix->covariance(0, 0)));
}

TEST(Receiver, MayDeclareNeitherCovarianceNorVelocity) {
  ReceiverParameters silent;
  silent.declares_covariance = silent.publishes_velocity = false;
  Receiver with(ReceiverParameters{}, 3);
  Receiver without(silent, 3);
  for (int i = 0; i < 50; ++i) {
    const ReceiverEpoch usual = with.epoch(kEpoch, {2.0 * i, 0.0, 0.0}, {10.0, 0.0, 0.0}, open_sky());
    const ReceiverEpoch epoch = without.epoch(kEpoch, {2.0 * i, 0.0, 0.0}, {10.0, 0.0, 0.0}, open_sky());
    ASSERT_EQ(epoch.fix.has_value(), usual.fix.has_value());
    if (!epoch.fix) continue;
    EXPECT_EQ(usual.fix->covariance_type, CovarianceType::kApproximated);
    EXPECT_GT(usual.fix->velocity_sigma_mps, 0.0);
    EXPECT_EQ(epoch.fix->covariance_type, CovarianceType::kUnknown);
    EXPECT_EQ(epoch.fix->velocity_sigma_mps, 0.0);
    EXPECT_EQ(epoch.fix->position, usual.fix->position) << "smoothed with the velocity all the same";
  }
}

TEST(Receiver, ReportsWhatReceiversReport) {
  Receiver receiver(ReceiverParameters{}, 3);
  auto sky = open_sky();
  sky.push_back(satellite(30, 359.7, 3.0));  // under the mask
  sky.push_back(behind_a_wall(10.0, 90.0));
  sky.back().id.svid = 31;
  ReceiverEpoch epoch;
  std::vector<double> latencies;
  for (int i = 0; i < 200; ++i) {
    epoch = receiver.epoch(kEpoch, Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero(), sky);
    latencies.push_back(epoch.latency_s);
  }
  EXPECT_GE(quantile(latencies, 0.0), 0.05);
  EXPECT_LE(quantile(latencies, 1.0), 0.2);
  EXPECT_GT(quantile(latencies, 1.0) - quantile(latencies, 0.0), 0.14);
  ASSERT_EQ(epoch.satellites.size(), sky.size());
  for (std::size_t i = 0; i < sky.size(); ++i) {
    const SatelliteReport& report = epoch.satellites[i];
    EXPECT_EQ(report.id, sky[i].id);
    const double azimuth_deg = radians_to_degrees(report.look.azimuth_rad);
    const double elevation_deg = radians_to_degrees(report.look.elevation_rad);
    EXPECT_NEAR(azimuth_deg, std::round(azimuth_deg), 1e-9);
    EXPECT_NEAR(elevation_deg, std::round(elevation_deg), 1e-9);
    EXPECT_LT(std::abs(angle_difference(report.look.azimuth_rad, sky[i].look.azimuth_rad)), 0.51 * kPi / 180.0);
    EXPECT_GE(report.look.azimuth_rad, 0.0);
    EXPECT_LT(report.look.azimuth_rad, 2.0 * kPi - 1e-9);
    if (i < 14) {
      EXPECT_TRUE(report.is_tracked && report.is_used);
      EXPECT_EQ(report.cn0_dbhz, std::round(report.cn0_dbhz));
      EXPECT_TRUE(std::isfinite(report.residual_m));
    }
  }
  EXPECT_TRUE(epoch.satellites[14].is_tracked);
  EXPECT_FALSE(epoch.satellites[14].is_used);
  EXPECT_TRUE(std::isnan(epoch.satellites[14].residual_m));
  EXPECT_FALSE(epoch.satellites[15].is_tracked);
  EXPECT_TRUE(std::isnan(epoch.satellites[15].cn0_dbhz));
  EXPECT_TRUE(std::isnan(epoch.satellites[15].range_error_m));
}

TEST(Receiver, LosesTheFixUnderFourSatellitesAndFindsItAgain) {
  ReceiverParameters parameters;
  parameters.channel.acquisition_time = 1.0;
  Receiver receiver(parameters, 1);
  const auto sky = open_sky();
  const std::vector<ReceivedSatellite> three(sky.begin(), sky.begin() + 3);
  const auto has_fix = [&](const std::vector<ReceivedSatellite>& satellites) {
    const ReceiverEpoch epoch = receiver.epoch(kEpoch, Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero(), satellites);
    EXPECT_EQ(epoch.fix.has_value(), epoch.used_count > 0);
    EXPECT_EQ(epoch.fix.has_value(), std::isfinite(epoch.hdop));
    return epoch.fix.has_value();
  };
  int until_fix = 0;
  while (!has_fix(sky)) ++until_fix;
  EXPECT_EQ(until_fix, 5);
  for (int i = 0; i < 10; ++i) EXPECT_FALSE(has_fix(three));
  until_fix = 0;
  while (!has_fix(sky)) ++until_fix;
  EXPECT_EQ(until_fix, 5);
  EXPECT_FALSE(has_fix({}));
}

TEST(Receiver, SmoothingStartsAnewAfterCoasting) {
  ReceiverParameters parameters = without_noise();
  parameters.smoothing_time = 8.0;
  parameters.coasting_time = 3.0;
  const auto error_after = [&](int missing_epochs) {
    Receiver receiver(parameters, 1);
    const Eigen::Vector3d still = Eigen::Vector3d::Zero();
    for (int i = 0; i < 50; ++i) receiver.epoch(kEpoch, still, still, open_sky());
    for (int i = 0; i < missing_epochs; ++i) receiver.epoch(kEpoch, still, still, {});
    const Eigen::Vector3d elsewhere(40.0, 0.0, 0.0);  // carried there without the receiver's notice
    return (receiver.epoch(kEpoch, elsewhere, still, open_sky()).fix->position - elsewhere).norm();
  };
  EXPECT_NEAR(error_after(0), 40.0 * std::exp(-kEpoch / 8.0), 0.1);
  EXPECT_NEAR(error_after(10), 40.0 * std::exp(-kEpoch / 8.0), 0.1);
  EXPECT_NEAR(error_after(20), 0.0, 0.1);
}

TEST(Receiver, SeedDecidesAndSatellitesDoNotDisturbEachOther) {
  const auto errors = [](std::uint64_t seed, std::size_t count) {
    Receiver receiver(ReceiverParameters{}, seed);
    auto sky = open_sky();
    sky.resize(count);
    std::vector<double> result;
    for (int i = 0; i < 50; ++i) {
      const auto epoch = receiver.epoch(kEpoch, Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero(), sky);
      if (i > 10) result.push_back(epoch.satellites[2].range_error_m);
    }
    return result;
  };
  EXPECT_EQ(errors(1, 14), errors(1, 14));
  EXPECT_EQ(errors(1, 14), errors(1, 5));
  EXPECT_NE(errors(1, 14), errors(2, 14));
}

/// A smoothed fix, and one that is not, some way off: the residuals are those of what is published.
TEST(Receiver, ResidualsLeadFromTheFixToTheTruth) {
  for (const double smoothing_time : {0.0, 8.0}) {
    ReceiverParameters parameters = without_noise();
    parameters.smoothing_time = smoothing_time;
    parameters.angle_resolution = 0.0;
    parameters.clock_walk = 5.0;
    Receiver receiver(parameters, 1);
    const Eigen::Vector3d still = Eigen::Vector3d::Zero();
    for (int i = 0; i < 20; ++i) receiver.epoch(kEpoch, still, still, open_sky());
    const Eigen::Vector3d moved(30.0, -20.0, 4.0);  // without the receiver's notice
    for (int i = 0; i < 5; ++i) {
      const ReceiverEpoch epoch = receiver.epoch(kEpoch, moved, still, open_sky());
      ASSERT_TRUE(epoch.fix);
      const Eigen::Vector2d error = (moved - epoch.fix->position).head<2>();
      if (smoothing_time > 0.0) {
        EXPECT_GT(error.norm(), 30.0);
      }
      const auto observations = to_observations(epoch.satellites);
      NominalCn0 nominal;
      nominal.add(observations, {});
      RangeFixParameters p;
      p.nlos.mean = 1000.0;  // nothing is NLOS
      const auto fix =
          range_fix(observations, *nominal.dbhz(), {Eigen::Vector2d::Zero(), 1e4 * Eigen::Matrix2d::Identity()}, p);
      ASSERT_TRUE(fix);
      EXPECT_LT((fix->offset - error).norm(), 0.2) << smoothing_time << ", " << i;
    }
  }
}

/// NMEA's GRS: the clocks that fit best at the position, by the weights of the receiver.
TEST(Receiver, ResidualsOfAConstellationAverageToNothing) {
  ReceiverParameters parameters;
  parameters.channel.acquisition_time = 0.0;
  Receiver receiver(parameters, 5);
  auto sky = open_sky();
  sky[2].paths.reflections = {reflection(30.0, 3.0)};
  sky[10].paths.is_blocked = true;
  sky[10].paths.has_direct = false;
  sky[10].paths.reflections = {reflection(50.0, 6.0)};
  int fixes = 0;
  double largest = 0.0;
  for (int i = 0; i < 50; ++i) {
    const Eigen::Vector3d antenna(3.0 * i, 0.0, 1.0);
    const ReceiverEpoch epoch = receiver.epoch(kEpoch, antenna, {2.0, 0.0, 0.0}, sky);
    if (!epoch.fix) continue;
    ++fixes;
    std::map<Constellation, double> sum, weights;
    for (const SatelliteReport& report : epoch.satellites) {
      EXPECT_EQ(report.is_used, std::isfinite(report.residual_m));
      if (!report.is_used) continue;
      const double weight = std::pow(10.0, 0.1 * (report.cn0_dbhz - 40.0));  // of a variance that falls with C/N0
      sum[report.id.constellation] += weight * report.residual_m;
      weights[report.id.constellation] += weight;
      largest = std::max(largest, std::abs(report.residual_m));
    }
    EXPECT_EQ(sum.size(), 2u);
    for (const auto& [constellation, value] : sum) EXPECT_NEAR(value / weights[constellation], 0.0, 1e-9);
  }
  EXPECT_GT(fixes, 30);
  EXPECT_GT(largest, 10.0);
}

TEST(Receiver, ParametersMustBeInOrder) {
  ReceiverParameters parameters;
  std::vector<std::string> faults;
  faults = faults_of(parameters);
  EXPECT_TRUE(faults.empty());
  parameters.latency_min = 0.3;
  parameters.channel.tracking_threshold = 40.0;
  parameters.channel.cn0_horizon = 60.0;
  faults = faults_of(parameters);
  EXPECT_EQ(faults.size(), 3u);
}

}  // namespace
}  // namespace urban_gnss
