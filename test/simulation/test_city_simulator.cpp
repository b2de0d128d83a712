#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include "city_rig.hpp"
#include "matchers.hpp"

namespace urban_gnss {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

class Text {
 public:
  Text() { out_ << std::hexfloat; }
  template <class... T>
  Text& operator()(const T&... values) {
    ((out_ << values << ' '), ...);
    return *this;
  }
  Text& operator()(const Vector3d& v) { return (*this)(v.x(), v.y(), v.z()); }
  Text& operator()(const Pose2& pose) { return (*this)(pose.x, pose.y, pose.yaw); }
  Text& operator()(const Twist2& twist) { return (*this)(twist.speed_mps, twist.yaw_rate_radps); }
  std::string str() const { return out_.str(); }

 private:
  std::ostringstream out_;
};

struct Describe {
  Text& text;
  void operator()(const TruthEvent& e) const { text("truth")(e.pose)(e.twist); }
  void operator()(const OdometryEvent& e) const {
    text("odometry")(e.pose)(e.twist)(e.speed_variance, e.yaw_rate_variance);
  }
  void operator()(const ImuMessage& e) const { text("imu")(e.angular_velocity_radps)(e.acceleration_mps2); }
  void operator()(const SatellitesEvent& e) const {
    text("satellites");
    for (const SatelliteReport& s : e.satellites) {
      text(satellite_name(s.id), s.look.azimuth_rad, s.look.elevation_rad, s.cn0_dbhz, s.range_error_m, s.is_used);
    }
  }
  void operator()(const FixEvent& e) const {
    text("fix", e.published.publisher, e.published.has_fix, e.used_count);
    text(e.published.fix.position)(e.published.fix.velocity)(e.published.fix.covariance(0, 0));
  }
  void operator()(const FixTruthEvent& e) const { text("error")(e.error); }
  void operator()(const SignalsEvent& e) const {
    text("signals");
    for (const SignalTruth& s : e.signals)
      text(static_cast<int>(s.report.path_class), s.look.azimuth_rad, s.path.size());
  }
  void operator()(const LidarScan& e) const {
    text("scan", e.size());
    for (std::size_t i = 0; i < e.size(); ++i) text(e.x[i], e.y[i], e.z[i], e.intensity[i], e.ring[i]);
  }
};

/// Everything of the events, number by number; of the kinds of content that are named.
template <class... Kinds>
std::string describe(const Events& events) {
  Text text;
  for (const SimulationEvent& event : events) {
    if (sizeof...(Kinds) > 0 && !(std::holds_alternative<Kinds>(event.content) || ...)) continue;
    text(event.stamp.count(), event.published.count());
    std::visit(Describe{text}, event.content);
  }
  return text.str();
}

const std::vector<std::string> kShortCity{"duration=4", "lidar.points_per_revolution=100", "lidar.beams=4"};

std::vector<std::string> operator+(std::vector<std::string> a, const std::vector<std::string>& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

TEST(CitySimulator, SameScenarioAndSeedGiveTheSameEvents) {
  const std::string first = describe(run(scenario("downtown_grid", kShortCity)));
  EXPECT_TRUE(first == describe(run(scenario("downtown_grid", kShortCity))));
}

// A robot that stands does so the same with every seed: what differs is the sensors' noise.
TEST(CitySimulator, SeedDecidesOnEverySensor) {
  const auto standing = [](const char* seed) {
    CitySimulator simulator(scenario("downtown_grid", kShortCity + std::vector<std::string>{seed}));
    Events events;
    while (!simulator.is_finished()) simulator.step(Twist2{}, events);
    return events;
  };
  const Events one = standing("seed=1");
  const Events two = standing("seed=2");
  EXPECT_EQ(describe<TruthEvent>(one), describe<TruthEvent>(two));
  EXPECT_NE(describe<ImuMessage>(one), describe<ImuMessage>(two));
  EXPECT_NE(describe<FixEvent>(one), describe<FixEvent>(two));
  EXPECT_NE(describe<SatellitesEvent>(one), describe<SatellitesEvent>(two));
  EXPECT_NE(describe<LidarScan>(one), describe<LidarScan>(two));
  const Events driven = run(scenario("downtown_grid", kShortCity));
  const Events other = run(scenario("downtown_grid", kShortCity + std::vector<std::string>{"seed=2"}));
  EXPECT_NE(describe<TruthEvent>(driven), describe<TruthEvent>(other));
  EXPECT_NE(describe<OdometryEvent>(driven), describe<OdometryEvent>(other));
}

// Each sensor draws from a stream of its own.
TEST(CitySimulator, ParametersOfOneSensorLeaveTheOthersNoise) {
  const Events before = run(scenario("downtown_grid", kShortCity));
  const auto after = [](const std::vector<std::string>& overrides) {
    return run(scenario("downtown_grid", kShortCity + overrides));
  };
  const auto same = [&](const Events& events, auto kind) {
    using Kind = decltype(kind);
    return describe<Kind>(before) == describe<Kind>(events);
  };
  const auto fix_is_same = [&](const Events& events) {
    return same(events, FixEvent()) && same(events, FixTruthEvent()) && same(events, SatellitesEvent()) &&
           same(events, SignalsEvent());
  };

  const Events imu = after({"imu.gyro_noise_density=0.01", "imu.gyro_bias_sigma=0.1"});
  EXPECT_FALSE(same(imu, ImuMessage()));
  EXPECT_TRUE(same(imu, TruthEvent()) && same(imu, OdometryEvent()) && same(imu, LidarScan()) && fix_is_same(imu));

  const Events odometry = after({"odometry.speed_noise_density=0.1", "odometry.tick=0"});
  EXPECT_FALSE(same(odometry, OdometryEvent()));
  EXPECT_TRUE(same(odometry, TruthEvent()) && same(odometry, ImuMessage()) && same(odometry, LidarScan()));
  EXPECT_TRUE(fix_is_same(odometry));

  const Events receiver = after({"receiver.rate=2", "receiver.latency_max=0.1", "signals.max_reflections=0"});
  EXPECT_FALSE(fix_is_same(receiver));
  EXPECT_TRUE(same(receiver, TruthEvent()) && same(receiver, OdometryEvent()) && same(receiver, ImuMessage()));
  EXPECT_TRUE(same(receiver, LidarScan()));

  const Events lidar = after({"lidar.dropout=0.5", "lidar.rate=5"});
  EXPECT_FALSE(same(lidar, LidarScan()));
  EXPECT_TRUE(same(lidar, TruthEvent()) && same(lidar, OdometryEvent()) && same(lidar, ImuMessage()));
  EXPECT_TRUE(fix_is_same(lidar));

  const Events fault = after({"faults=[{type: decoy, start: 1, duration: 2, offset: [9, 9, 0]}]"});
  EXPECT_FALSE(same(fault, FixEvent()));
  EXPECT_TRUE(same(fault, TruthEvent()) && same(fault, OdometryEvent()) && same(fault, ImuMessage()));
  EXPECT_TRUE(same(fault, SatellitesEvent()) && same(fault, LidarScan()));
}

TEST(CitySimulator, SensorsDeliverAtTheirRates) {
  const Scenario city = scenario("downtown_grid", kShortCity);
  const Events events = run(city);
  const auto count = [&](auto kind) { return of<decltype(kind)>(events, city).size(); };
  EXPECT_EQ(count(ImuMessage()), 400u);
  EXPECT_EQ(count(OdometryEvent()), 200u);
  EXPECT_EQ(count(TruthEvent()), 200u);
  EXPECT_NEAR(static_cast<double>(count(LidarScan())), 40.0, 1.0);
  EXPECT_NEAR(static_cast<double>(count(FixEvent())), 20.0, 1.0);
  EXPECT_EQ(count(SatellitesEvent()), count(FixEvent()));
  EXPECT_EQ(count(SignalsEvent()), count(FixEvent()));
  for (const auto& odometry : of<OdometryEvent>(events, city)) {
    EXPECT_GT(odometry.content->speed_variance, 0.0);
    EXPECT_GT(odometry.content->yaw_rate_variance, 0.0);
  }
  for (const auto& imu : of<ImuMessage>(events, city)) EXPECT_GT(imu.content->angular_velocity_variance, 0.0);
}

TEST(CitySimulator, FixesComeLateAndInOrder) {
  const Scenario sky = scenario("open_sky", {"duration=120"});
  const Events events = run(sky);
  expect_ascending(events);
  std::vector<double> latencies_s;
  for (const auto& fix : of<FixEvent>(events, sky)) latencies_s.push_back(fix.latency_s);
  ASSERT_GT(latencies_s.size(), 590u);
  const auto [low, high] = std::minmax_element(latencies_s.begin(), latencies_s.end());
  EXPECT_GE(*low, 0.05);
  EXPECT_LE(*high, 0.2);
  // Uniform: of 590 one is within 3 % of either end but for a chance of 0.97^590 = 2e-8.
  EXPECT_LT(*low, 0.0545);
  EXPECT_GT(*high, 0.1955);
  for (const auto& odometry : of<OdometryEvent>(events, sky)) EXPECT_EQ(odometry.latency_s, 0.0);
}

// Also where the latency varies by more than the time between two epochs.
TEST(CitySimulator, FastReceiverKeepsItsOrder) {
  const Scenario sky = scenario("open_sky", {"duration=20", "receiver.rate=20"});
  const Events events = run(sky);
  expect_ascending(events);
  const auto fixes = of<FixEvent>(events, sky);
  EXPECT_GT(fixes.size(), 390u);
  for (const auto& fix : fixes) {
    EXPECT_GE(fix.latency_s, 0.05 - 1e-9);
    EXPECT_LE(fix.latency_s, 0.2 + 1e-9);
  }
}

// The same run without the faults is the oracle: what differs is the faults' doing.
// The truth is an event of its own, and says exactly what is wrong with the published fix.
// The way of a tracked signal over its points is as much longer than the line of sight as is said of it.
TEST(CitySimulator, ScanIsInTheSensorsFrame) {
  Scenario city = scenario(
      "open_sky", {"duration=2", "lidar.type=spinning", "lidar.dropout=0", "lidar.mount_x=0.7", "odometry.rate=100"});
  Building wall;
  wall.footprint = {{-200.0, -90.0}, {200.0, -90.0}, {200.0, -80.0}, {-200.0, -80.0}};
  wall.roof_m = 30.0;
  city.world.buildings.push_back(wall);
  const Events events = run(city);
  std::map<double, Pose2> poses;
  for (const auto& truth : of<TruthEvent>(events, city)) poses[truth.time_s] = truth.content->pose;
  const auto scans = of<LidarScan>(events, city);
  ASSERT_GE(scans.size(), 18u);
  std::size_t on_wall = 0;
  std::size_t on_ground = 0;
  for (const auto& scan : scans) {
    const auto pose = std::find_if(poses.begin(), poses.end(),
                                   [&](const auto& entry) { return std::abs(entry.first - scan.time_s) < 1e-6; });
    if (pose == poses.end()) continue;
    const LidarScan& points = *scan.content;
    ASSERT_EQ(points.y.size(), points.size());
    ASSERT_EQ(points.z.size(), points.size());
    ASSERT_EQ(points.intensity.size(), points.size());
    ASSERT_EQ(points.ring.size(), points.size());
    for (std::size_t i = 0; i < points.size(); ++i) {
      EXPECT_LT(points.ring[i], city.lidar.beams);
      if (points.intensity[i] == intensity(Surface::kGround)) {
        EXPECT_NEAR(points.z[i], -city.lidar.mount_z, 6.0 * city.lidar.range_sigma);
        ++on_ground;
      } else if (points.intensity[i] == intensity(Surface::kBuilding)) {
        const double x = points.x[i] + city.lidar.mount_x;
        const double y = points.y[i] + city.lidar.mount_y;
        const double north = pose->second.y + std::sin(pose->second.yaw) * x + std::cos(pose->second.yaw) * y;
        EXPECT_NEAR(north, -80.0, 6.0 * city.lidar.range_sigma);
        ++on_wall;
      }
    }
  }
  EXPECT_GT(on_ground, 1000u);
  EXPECT_GT(on_wall, 1000u);
}

TEST(CitySimulator, CommandDrivesInsteadOfTheRoute) {
  CitySimulator commanded(scenario("open_sky"));
  CitySimulator standing(scenario("open_sky"));
  const Pose2 start = commanded.truth();
  Events events;
  for (int i = 0; i < 1000; ++i) {
    commanded.step(Twist2{5.0, 0.1}, events);
    standing.step(Twist2{}, events);
  }
  EXPECT_TRUE(standing.truth() == start);
  // 10 s to the left on a circle of 50 m, less what speeding up at 2 m/s^2 takes: 5^2/(2*2) m.
  const double turned = angle_difference(commanded.truth().yaw, start.yaw);
  EXPECT_NEAR(turned, (50.0 - 6.25) / 50.0, 0.15);
  const double chord = (commanded.truth().position() - start.position()).norm();
  EXPECT_NEAR(chord, 2.0 * 50.0 * std::sin(turned / 2.0), 2.0);
  EXPECT_FALSE(commanded.is_finished());
}

TEST(CitySimulator, FollowsTheRouteToItsEnd) {
  const Scenario pass = scenario("building_pass", {"lidar.type=none"});
  CitySimulator simulator(pass);
  Events events;
  double before = 0.0;
  const RouteFollower path(pass.route, pass.autopilot);
  while (!simulator.is_finished() && simulator.elapsed_s() < 600.0) {
    simulator.step(std::nullopt, events);
    EXPECT_GE(simulator.progress(), before);
    before = simulator.progress();
  }
  ASSERT_TRUE(simulator.is_finished());
  const Vector2d end = pass.route.waypoints.back().position;
  EXPECT_LT((simulator.truth().position() - end).norm(), 3.0);
  for (const auto& truth : of<TruthEvent>(events, pass)) {
    if (std::fmod(truth.time_s, 1.0) > 0.015) continue;
    double nearest_m = 1e9;
    for (const auto& point : path.path()) {
      nearest_m = std::min(nearest_m, (point.position - truth.content->pose.position()).norm());
    }
    EXPECT_LT(nearest_m, 1.5) << truth.time_s;
  }
}

TEST(CitySimulator, EndsAfterTheDuration) {
  CitySimulator simulator(scenario("open_sky", {"duration=3"}));
  EXPECT_EQ(simulator.now(), simulator.scenario().start_time);
  Events events;
  for (int i = 0; i < 150; ++i) simulator.step(std::nullopt, events);
  EXPECT_NEAR(simulator.progress(), 0.5, 1e-6);
  EXPECT_FALSE(simulator.is_finished());
  for (int i = 0; i < 150; ++i) simulator.step(std::nullopt, events);
  EXPECT_TRUE(simulator.is_finished());
  EXPECT_EQ(simulator.progress(), 1.0);
  EXPECT_EQ(simulator.now() - simulator.scenario().start_time, Stamp(3000000000LL));
}

TEST(CitySimulator, AbsentAlmanacIsRefused) {
  EXPECT_THROW(CitySimulator(scenario("open_sky", {"sky.almanac=absent.alm"})), std::runtime_error);
}

}  // namespace
}  // namespace urban_gnss
