#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "matchers.hpp"
#include "urban_gnss_localization/simulation/paper_field_simulator.hpp"

namespace urban_gnss {
namespace {

MotionParameters motion() {
  MotionParameters parameters;
  parameters.motion_model = MotionModel::kBicycle;
  parameters.odom_noise_scale = 1e-3;
  return parameters;
}

template <class Content>
const Content& only(const std::vector<SimulationEvent>& events) {
  const Content* found = nullptr;
  for (const SimulationEvent& event : events) {
    const auto* content = std::get_if<Content>(&event.content);
    if (content == nullptr) continue;
    EXPECT_EQ(found, nullptr) << "twice";
    found = content;
  }
  if (found == nullptr) throw std::runtime_error("no such event");
  return *found;
}

TEST(PaperFieldSimulator, GivesWhatTheFieldGivesSteppedByHand) {
  PaperFieldParameters parameters;
  parameters.seed = 5;
  PaperFieldSimulator simulator(parameters, motion());
  PaperField field(parameters, motion());
  EXPECT_TRUE(simulator.truth() == field.truth());
  Pose2 odometry;
  bool was_in_shadow = false;
  for (int i = 0; i < 1000; ++i) {
    // A curve, a straight and a stand.
    const Twist2 twist = i < 700 ? Twist2{10.0, 10.0 / 15.0} : i < 900 ? Twist2{4.0, 0.0} : Twist2{};
    std::vector<SimulationEvent> events;
    simulator.step(twist, events);
    field.step(bicycle_input(twist, motion().wheelbase));
    const SimulatedFix fix = field.fix();
    ASSERT_TRUE(simulator.truth() == field.truth()) << i;
    ASSERT_EQ(events.size(), 4u);
    EXPECT_TRUE(only<TruthEvent>(events).pose == field.truth());
    const auto& published = only<FixEvent>(events).published;
    EXPECT_EQ(published.publisher, 0);
    EXPECT_TRUE(published.has_fix);
    EXPECT_EQ(published.fix.position, Eigen::Vector3d(fix.position.x(), fix.position.y(), 0.0));
    const auto& truth = only<FixTruthEvent>(events);
    EXPECT_EQ(truth.in_shadow, std::optional<bool>(fix.in_shadow));
    EXPECT_LT((truth.error.head<2>() - (fix.position - field.truth().position())).norm(), 1e-12);
    was_in_shadow |= fix.in_shadow;

    odometry = move(odometry, twist, parameters.interval);
    EXPECT_TRUE(near(only<OdometryEvent>(events).pose, odometry, 1e-6)) << i;
    EXPECT_NEAR(only<OdometryEvent>(events).twist.yaw_rate_radps, twist.yaw_rate_radps, 1e-12);
    for (const SimulationEvent& event : events) {
      EXPECT_EQ(event.stamp, PaperFieldSimulator::kStart + from_seconds(0.01 * (i + 1)));
      EXPECT_EQ(event.published, event.stamp);
    }
  }
  EXPECT_TRUE(was_in_shadow);
}

TEST(PaperFieldSimulator, ClaimsDirectReceptionEverywhere) {
  PaperFieldParameters parameters;
  PaperFieldSimulator simulator(parameters, motion());
  for (int i = 0; i < 600; ++i) {
    std::vector<SimulationEvent> events;
    simulator.step(Twist2{10.0, 10.0 / 15.0}, events);
    EXPECT_DOUBLE_EQ(only<FixEvent>(events).published.fix.covariance(0, 0), std::pow(parameters.fix_direct_sigma, 2));
    EXPECT_GT(only<OdometryEvent>(events).speed_variance, 0.0);
  }
  parameters.fix_direct_sigma = 0.0;
  PaperFieldSimulator exact(parameters, motion());
  std::vector<SimulationEvent> events;
  exact.step(Twist2{}, events);
  EXPECT_GT(only<FixEvent>(events).published.fix.covariance(0, 0), 0.0) << "still a covariance";
}

TEST(PaperFieldSimulator, DrivesRoundTheTargetsByItself) {
  PaperFieldParameters parameters;
  PaperFieldSimulator simulator(parameters, motion(), 20.0);
  const std::vector<double> targets = parameters.targets();
  std::vector<double> nearest_m(targets.size() / 2, 1e9);
  std::vector<SimulationEvent> events;
  while (!simulator.is_finished()) {
    events.clear();
    simulator.step(std::nullopt, events);
    for (std::size_t i = 0; i < nearest_m.size(); ++i) {
      const Eigen::Vector2d target(targets[2 * i], targets[2 * i + 1]);
      nearest_m[i] = std::min(nearest_m[i], (simulator.truth().position() - target).norm());
    }
  }
  for (const double distance_m : nearest_m) EXPECT_LT(distance_m, 2.0);
  EXPECT_EQ(simulator.now(), PaperFieldSimulator::kStart + from_seconds(20.0));
  EXPECT_EQ(simulator.progress(), 1.0);
}

TEST(PaperFieldSimulator, WithoutADurationItNeverEnds) {
  PaperFieldSimulator simulator({}, motion());
  std::vector<SimulationEvent> events;
  for (int i = 0; i < 3000; ++i) simulator.step(std::nullopt, events);
  EXPECT_FALSE(simulator.is_finished());
  EXPECT_GE(simulator.progress(), 0.0);
  EXPECT_LE(simulator.progress(), 1.0);
}

TEST(PaperFieldSimulator, SeedDecides) {
  const auto end = [](int seed) {
    PaperFieldParameters parameters;
    parameters.seed = seed;
    PaperFieldSimulator simulator(parameters, motion(), 2.0);
    std::vector<SimulationEvent> events;
    while (!simulator.is_finished()) simulator.step(std::nullopt, events);
    return simulator.truth();
  };
  EXPECT_TRUE(end(3) == end(3));
  EXPECT_FALSE(end(3) == end(4));
}

}  // namespace
}  // namespace urban_gnss
