#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <string>

#include "city_rig.hpp"
#include "matchers.hpp"
#include "urban_gnss_localization/simulation/simulation_statistics.hpp"

namespace urban_gnss {
namespace {

using Eigen::Vector3d;

TEST(CityScenarios, NoSatelliteInTheTunnelAndAFixAfterIt) {
  const Scenario tunnel = scenario("tunnel", {"lidar.type=none"});
  const Events events = run(tunnel);
  expect_ascending(events);
  double first_dark_s = -1.0;
  double last_dark_s = -1.0;
  for (const auto& signals : of<SignalsEvent>(events, tunnel)) {
    if (signals.time_s < kAcquired_s) continue;
    const auto& all = signals.content->signals;
    EXPECT_GT(all.size(), 5u) << "they are above the horizon all the same";
    if (std::any_of(all.begin(), all.end(), [](const auto& s) { return s.report.is_tracked; })) continue;
    if (first_dark_s < 0.0) first_dark_s = last_dark_s = signals.time_s;
    EXPECT_LT(signals.time_s - last_dark_s, 0.201) << "dark in one piece";
    last_dark_s = signals.time_s;
  }
  EXPECT_GE(last_dark_s - first_dark_s, 60.0);

  double regained_s = -1.0;
  std::size_t before = 0;
  for (const auto& fix : of<FixEvent>(events, tunnel)) {
    const bool has_fix = fix.content->published.has_fix;
    if (fix.time_s < first_dark_s - 1.0) before += has_fix;
    if (fix.time_s >= first_dark_s && fix.time_s <= last_dark_s) {
      EXPECT_FALSE(has_fix) << fix.time_s;
      EXPECT_EQ(fix.content->used_count, 0);
    }
    if (has_fix && fix.time_s > last_dark_s && regained_s < 0.0) regained_s = fix.time_s;
  }
  EXPECT_GT(before, 100u);
  ASSERT_GT(regained_s, 0.0) << "never again";
  EXPECT_LT(regained_s - last_dark_s, 5.0);
  // Where the truth is known there is a fix, and the first after the tunnel is no memory of the last before it.
  for (const auto& truth : of<FixTruthEvent>(events, tunnel)) {
    EXPECT_FALSE(truth.time_s >= first_dark_s && truth.time_s <= last_dark_s);
    if (truth.time_s == regained_s) {
      EXPECT_LT(truth.content->error.head<2>().norm(), 100.0);
    }
  }
}

TEST(CityScenarios, EachFaultIsSeenAtItsTime) {
  const Scenario faulty = scenario("faulty_receiver", {"duration=360"});
  Scenario healthy = faulty;
  healthy.faults.clear();
  const Events events = run(faulty);
  expect_ascending(events);
  const auto clean = own_fixes(run(healthy));
  const auto fixes = own_fixes(events);
  ASSERT_EQ(fixes.size(), clean.size());
  std::map<std::string, int> seen;
  Vector3d frozen = Vector3d::Zero();
  Vector3d decoy_mean = Vector3d::Zero();
  for (const auto& [stamp, fix] : fixes) {
    const double t = to_seconds(stamp - faulty.start_time);
    const PublishedFix& right = clean.at(stamp);
    if (t < kAcquired_s) continue;
    ASSERT_TRUE(right.has_fix) << t;
    const Vector3d change = fix.fix.position - right.fix.position;
    if (t >= 60.0 && t < 70.0) {
      const bool is_hit = change.norm() > 1.0;
      EXPECT_LT((change - (is_hit ? Vector3d(150.0, -80.0, 0.0) : Vector3d::Zero())).norm(), 1e-9) << t;
      seen["spike"] += is_hit;
      seen["spared by the spike"] += !is_hit;
    } else if (t >= 100.0 && t < 120.0) {
      EXPECT_FALSE(fix.has_fix) << t;
      ++seen["blackout"];
    } else if (t >= 120.0 && t < 128.0) {
      decoy_mean += change;
      EXPECT_LT((change - Vector3d(-40.0, 25.0, 0.0)).norm(), 5.0 * 0.5) << t;
      ++seen["decoy"];
    } else if (t >= 170.0 && t < 230.0) {
      EXPECT_LT((change - (t - 170.0) * Vector3d(0.2, 0.1, 0.0)).norm(), 1e-6) << t;
      ++seen["ramp"];
    } else if (t >= 260.0 && t < 265.0) {
      if (seen["freeze"]++ == 0) frozen = fix.fix.position;
      EXPECT_EQ(fix.fix.position, frozen) << t;
    } else if (t >= 290.0 && t < 295.0) {
      EXPECT_TRUE(fix.has_fix) << "the status says that there is one";
      const bool is_nan = fix.fix.position.array().isNaN().all();
      if (!is_nan) {
        EXPECT_EQ(fix.fix.position, right.fix.position) << t;
      }
      seen["nan"] += is_nan;
      seen["spared by the nan"] += !is_nan;
    } else {
      EXPECT_TRUE(fix.has_fix) << t;
      EXPECT_EQ(fix.fix.position, right.fix.position) << t;
    }
  }
  EXPECT_EQ(seen["spike"] + seen["spared by the spike"], 50);
  EXPECT_GE(seen["spike"], 1);
  EXPECT_LE(seen["spike"], 15) << "a tenth of 50; more than 15 with a chance of 1e-5";
  EXPECT_EQ(seen["blackout"], 100);
  EXPECT_EQ(seen["decoy"], 40);
  EXPECT_LT((decoy_mean / 40.0 - Vector3d(-40.0, 25.0, 0.0)).norm(), 4.5 * 0.5 * std::sqrt(3.0 / 40.0));
  EXPECT_EQ(seen["ramp"], 300);
  EXPECT_EQ(seen["freeze"], 25);
  EXPECT_GE(seen["nan"], 3) << "a half of 25";
  EXPECT_GE(seen["spared by the nan"], 3);

  int duplicates = 0;
  for (const auto& fix : of<FixEvent>(events, faulty)) {
    if (fix.content->published.publisher == 0) continue;
    ++duplicates;
    EXPECT_GE(fix.time_s, 320.0);
    EXPECT_LT(fix.time_s, 350.0);
    const Stamp stamp = faulty.start_time + from_seconds(fix.time_s);
    const Vector3d change = fix.content->published.fix.position - clean.at(stamp).fix.position;
    EXPECT_LT((change - Vector3d(5.0, 5.0, 0.0)).norm(), 1e-9);
  }
  EXPECT_EQ(duplicates, 150);
}

TEST(CityScenarios, FixTruthIsTheFixMinusTheAntenna) {
  const Scenario faulty = scenario("faulty_receiver", {"duration=75", "odometry.rate=50"});
  const Events events = run(faulty);
  const auto fixes = own_fixes(events);
  std::map<Stamp, Pose2> poses;
  for (const auto& truth : of<TruthEvent>(events, faulty)) {
    poses[faulty.start_time + from_seconds(truth.time_s)] = truth.content->pose;
  }
  std::size_t count = 0;
  for (const auto& truth : of<FixTruthEvent>(events, faulty)) {
    const Stamp stamp = faulty.start_time + from_seconds(truth.time_s);
    ASSERT_EQ(poses.count(stamp), 1u);
    const Pose2& pose = poses[stamp];
    const Vector3d arm = faulty.vehicle.antenna();
    const Vector3d antenna(pose.x + std::cos(pose.yaw) * arm.x() - std::sin(pose.yaw) * arm.y(),
                           pose.y + std::sin(pose.yaw) * arm.x() + std::cos(pose.yaw) * arm.y(), arm.z());
    EXPECT_LT((fixes.at(stamp).fix.position - antenna - truth.content->error).norm(), 1e-9);
    EXPECT_FALSE(truth.content->in_shadow.has_value());
    ++count;
  }
  const auto good = std::count_if(fixes.begin(), fixes.end(), [](const auto& fix) { return fix.second.has_fix; });
  EXPECT_EQ(count, static_cast<std::size_t>(good));
  EXPECT_GT(count, 360u);
}

TEST(CityScenarios, ALateFixIsWhereTheAntennaWas) {
  const double delay_s = 1.5;
  const Scenario late = scenario("open_sky", {"duration=60", "receiver.fix_delay=1.5", "imu.rate=0"});
  const Events events = run(late);
  expect_ascending(events);
  EXPECT_TRUE(of<ImuMessage>(events, late).empty());
  std::map<Stamp, Vector3d> antennas;
  for (const auto& truth : of<TruthEvent>(events, late)) {
    const Pose2& pose = truth.content->pose;
    const Vector3d arm = late.vehicle.antenna();
    antennas[late.start_time + from_seconds(truth.time_s)] = {
        pose.x + std::cos(pose.yaw) * arm.x() - std::sin(pose.yaw) * arm.y(),
        pose.y + std::sin(pose.yaw) * arm.x() + std::cos(pose.yaw) * arm.y(), arm.z()};
  }
  const auto fixes = own_fixes(events);
  double then_m = 0.0;
  double now_m = 0.0;
  double count = 0.0;
  for (const auto& truth : of<FixTruthEvent>(events, late)) {
    const Stamp stamp = late.start_time + from_seconds(truth.time_s);
    const Vector3d place = fixes.at(stamp).fix.position;
    EXPECT_LT((place - antennas.at(stamp) - truth.content->error).norm(), 1e-9);
    if (truth.time_s < 15.0) continue;  // it drives
    then_m += (place - antennas.at(stamp - from_seconds(delay_s))).head<2>().norm();
    now_m += truth.content->error.head<2>().norm();
    count += 1.0;
  }
  EXPECT_GT(count, 200.0);
  EXPECT_LT(then_m / count, 4.0);
  EXPECT_GT(now_m / count, 7.0) << "some 10 m/s for 1.5 s";
}

TEST(CityScenarios, SegwayOdometryIsOffAsRecorded) {
  const Scenario segway = scenario("campus_segway");
  const std::map<double, double> recorded_rad{{1.0, 0.018}, {10.0, 0.08}, {30.0, 0.13}};  // by time in s
  std::map<double, double> squares;
  double distance_m = 0.0;
  const int seeds = 4000;
  const Twist2 straight{segway.route.waypoints.front().speed_mps, 0.0};
  for (int seed = 0; seed < seeds; ++seed) {
    WheelOdometry odometry(segway.odometry, segway.vehicle.drive, 0.0, static_cast<std::uint64_t>(seed));
    double yaw_rad = 0.0;
    for (int i = 1; i <= 1500; ++i) {
      const auto message = odometry.advance(straight, 0.02);
      ASSERT_TRUE(message);
      yaw_rad += 0.02 * message->twist.yaw_rate_radps;
      distance_m += 0.02 * message->twist.speed_mps;
      if (recorded_rad.count(i / 50.0) > 0) squares[i / 50.0] += yaw_rad * yaw_rad;
    }
  }
  // 8 % is what one process leaves of the recorded figures, to which comes 5 sigma of a root of a mean of squares.
  for (const auto& [time_s, recorded] : recorded_rad) {
    const double rms_rad = std::sqrt(squares[time_s] / seeds);
    RecordProperty("yaw_rms_rad_" + std::to_string(static_cast<int>(time_s)) + "_s", std::to_string(rms_rad));
    EXPECT_NEAR(rms_rad / recorded, 1.0, 0.08 + 5.0 / std::sqrt(2.0 * seeds)) << time_s << " s: " << rms_rad;
  }
  EXPECT_NEAR(distance_m / (seeds * 30.0 * straight.speed_mps), 1.07, 0.005);
}

TEST(CityScenarios, SegwayPublishesFixesAlone) {
  const Scenario segway = scenario("campus_segway", {"duration=60"});
  const Events events = run(segway);
  expect_ascending(events);
  EXPECT_TRUE(of<ImuMessage>(events, segway).empty());
  EXPECT_TRUE(of<SatellitesEvent>(events, segway).empty());
  const auto fixes = own_fixes(events);
  EXPECT_EQ(fixes.size(), 59u) << "one a second; the last is still on its way";
  for (const auto& [stamp, fix] : fixes) {
    if (!fix.has_fix) continue;
    EXPECT_EQ(fix.fix.covariance_type, CovarianceType::kUnknown);
    EXPECT_EQ(fix.fix.velocity_sigma_mps, 0.0);
  }
}

// The sensors of Kim et al., section 2.1 and 4.1: 5 ms, 1 s, and 0.3 to 0.5 m in the open.
TEST(CityScenarios, DgpsOfKim) {
  double error_m = 0.0;
  int count = 0;
  for (int seed = 1; seed <= 40; ++seed) {
    const Scenario pass = scenario("building_pass_dgps", {"duration=60", "seed=" + std::to_string(seed)});
    const Events events = run(pass);
    const auto odometry = of<OdometryEvent>(events, pass);
    ASSERT_EQ(odometry.size(), 12000u);
    EXPECT_NEAR(odometry[1].time_s - odometry[0].time_s, 0.005, 1e-9);
    EXPECT_TRUE(of<ImuMessage>(events, pass).empty());
    EXPECT_TRUE(of<SatellitesEvent>(events, pass).empty());
    for (const auto& [stamp, fix] : own_fixes(events)) {
      if (!fix.has_fix) continue;
      EXPECT_EQ(fix.fix.velocity_sigma_mps, 0.0);
      EXPECT_LT(std::sqrt(fix.fix.covariance(0, 0)), 1.0);
    }
    EXPECT_NEAR(static_cast<double>(own_fixes(events).size()), 59.0, 1.0);
    for (const auto& truth : of<FixTruthEvent>(events, pass)) {
      error_m += truth.content->error.head<2>().norm();
      ++count;
    }
  }
  RecordProperty("error_m", std::to_string(error_m / count));
  EXPECT_GT(error_m / count, 0.3);
  EXPECT_LT(error_m / count, 0.5);
}

TEST(CityScenarios, SatellitesAreReportedInWholeDegrees) {
  const Scenario city = scenario("downtown_grid", {"duration=20", "lidar.type=none"});
  const Events events = run(city);
  const auto reported = of<SatellitesEvent>(events, city);
  const auto signals = of<SignalsEvent>(events, city);
  ASSERT_EQ(reported.size(), signals.size());
  double largest_deg = 0.0;
  for (std::size_t k = 0; k < reported.size(); ++k) {
    EXPECT_DOUBLE_EQ(reported[k].content->angle_resolution_rad, kPi / 180.0);
    ASSERT_EQ(reported[k].content->satellites.size(), signals[k].content->signals.size());
    for (std::size_t i = 0; i < signals[k].content->signals.size(); ++i) {
      const SatelliteReport& report = reported[k].content->satellites[i];
      const SignalTruth& truth = signals[k].content->signals[i];
      EXPECT_EQ(report.id, truth.report.id);
      for (const double angle : {report.look.azimuth_rad, report.look.elevation_rad}) {
        const double degrees = angle * 180.0 / kPi;
        EXPECT_NEAR(degrees, std::round(degrees), 1e-9);
      }
      const double azimuth_error = angle_difference(report.look.azimuth_rad, truth.look.azimuth_rad);
      const double elevation_error = report.look.elevation_rad - truth.look.elevation_rad;
      for (const double error : {azimuth_error, elevation_error}) {
        largest_deg = std::max(largest_deg, std::abs(error) * 180.0 / kPi);
      }
    }
  }
  EXPECT_LE(largest_deg, 0.5 + 1e-9);
  EXPECT_GT(largest_deg, 0.3) << "the truth is not rounded";
}

TEST(CityScenarios, TrueSignalPathsHaveTheirLength) {
  const Scenario city = scenario("downtown_grid", {"duration=60", "lidar.type=none"});
  const Events events = run(city);
  std::size_t reflected = 0;
  for (const auto& signals : of<SignalsEvent>(events, city)) {
    for (const SignalTruth& signal : signals.content->signals) {
      ASSERT_FALSE(signal.path.empty());
      const bool is_tracked = signal.report.is_tracked;
      EXPECT_EQ(is_tracked, signal.report.path_class != PathClass::kBlocked);
      if (!is_tracked) continue;
      double length_m = 0.0;
      for (std::size_t i = 1; i < signal.path.size(); ++i) length_m += (signal.path[i] - signal.path[i - 1]).norm();
      const double ahead_m = (signal.path.back() - signal.path.front()).dot(line_of_sight(signal.look));
      EXPECT_TRUE(signal.has_line_of_sight || signal.path.size() > 1);
      // Chains take directions within 1e-3 rad for one: a centimetre on these lengths.
      EXPECT_NEAR(length_m - ahead_m, signal.report.excess_m, 0.02) << satellite_name(signal.report.id);
      reflected += signal.path.size() > 1 ? 1u : 0u;
    }
  }
  EXPECT_GT(reflected, 100u);
}

TEST(CityScenarios, ReceiverClaimsTooMuchInTheCity) {
  const auto summary = [](const Scenario& scenario) {
    SimulationStatistics statistics;
    for (const SimulationEvent& event : run(scenario)) statistics.add(event);
    return statistics.summary();
  };
  const ReceiverSummary city = summary(scenario("downtown_grid", {"duration=150", "lidar.type=none"}));
  const ReceiverSummary sky = summary(scenario("open_sky", {"duration=150"}));
  EXPECT_GT(city.nees_mean, 4.0) << "2 were honest";
  EXPECT_GT(city.error_m.median, 3.0 * sky.error_m.median);
  EXPECT_LT(sky.error_m.p95, 5.0);
  EXPECT_GT(sky.availability, 0.99) << "all but the first second";
  EXPECT_EQ(sky.classes[static_cast<std::size_t>(PathClass::kNlos)].count, 0u);
  EXPECT_GT(city.classes[static_cast<std::size_t>(PathClass::kNlos)].count, 100u);
}

}  // namespace
}  // namespace urban_gnss
