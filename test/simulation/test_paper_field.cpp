#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "matchers.hpp"
#include "package_directory.hpp"
#include "urban_gnss_localization/control/waypoint_controller.hpp"
#include "urban_gnss_localization/parameters/parameter_reader.hpp"
#include "urban_gnss_localization/simulation/paper_field.hpp"

namespace urban_gnss {
namespace {

/// The field whose shadow's border lies `depth_m` east of the start, so that the start is in it if that is positive.
PaperFieldParameters field_with_start_at_depth(double depth_m) {
  PaperFieldParameters parameters;
  parameters.shadow_border = parameters.start().x + depth_m;
  return parameters;
}

TEST(PaperField, FixHasTheNoiseAndTheBiasOfEq10And44And45) {
  const struct {
    double depth, bias, variance;
  } cases[] = {{-3.0, 0.0, 0.0025}, {2.0, 2.0, 0.1}, {4.99, 4.99, 0.1}, {12.0, 5.0, 0.1}};
  for (const auto& c : cases) {
    PaperField field(field_with_start_at_depth(c.depth), {});
    std::vector<double> east, north;
    for (int k = 0; k < 10000; ++k) {
      const SimulatedFix fix = field.fix();
      ASSERT_EQ(fix.in_shadow, c.depth > 0.0);
      ASSERT_NEAR(fix.bias.norm(), c.bias, 1e-12);
      const Eigen::Vector2d noise = fix.position - field.truth().position() - fix.bias;
      east.push_back(noise.x());
      north.push_back(noise.y());
    }
    EXPECT_TRUE(has_moments(east, 0.0, c.variance)) << c.depth;
    EXPECT_TRUE(has_moments(north, 0.0, c.variance)) << c.depth;
  }
}

TEST(PaperField, BiasPointsAlongMinusXOrAnywhere) {
  std::vector<double> directions;
  for (int seed = 1; seed <= 2000; ++seed) {
    PaperFieldParameters parameters = field_with_start_at_depth(3.0);
    parameters.seed = seed;
    PaperField random(parameters, {});
    const Eigen::Vector2d bias = random.fix().bias;
    EXPECT_EQ(random.fix().bias, bias);  // kept during one stay
    directions.push_back(std::atan2(bias.y(), bias.x()));
    parameters.bias_direction = BiasDirection::kNegativeX;
    EXPECT_LT((PaperField(parameters, {}).fix().bias - Eigen::Vector2d(-3.0, 0.0)).norm(), 1e-14);
  }
  std::sort(directions.begin(), directions.end());
  double largest = 0.0;
  for (std::size_t i = 0; i < directions.size(); ++i) {
    largest = std::max(largest, std::abs((directions[i] + kPi) / (2.0 * kPi) - (i + 0.5) / 2000.0));
  }
  EXPECT_LT(largest, 1.95 / std::sqrt(2000.0));  // Kolmogorov-Smirnov, exceeded once in a thousand
}

TEST(PaperField, DirectionIsDrawnAnewAtEachEntryAndTheBiasGrowsContinuously) {
  PaperFieldParameters parameters;
  WaypointControllerParameters steering;
  steering.targets = parameters.targets();
  steering.speed = 10.0;
  WaypointController controller(steering, 1);
  MotionParameters no_noise;
  no_noise.odom_noise_scale = 0.0;
  PaperField field(parameters, no_noise);
  std::vector<double> directions;
  SimulatedFix last = field.fix();
  for (int k = 0; k < 2500; ++k) {
    field.step(controller.steer(field.truth()));
    const SimulatedFix fix = field.fix();
    EXPECT_EQ(fix.in_shadow, field.truth().x < 0.0);
    // 0.1 m a step is the most that x, and with it the length, changes.
    if (fix.in_shadow == last.in_shadow) {
      EXPECT_LT((fix.bias - last.bias).norm(), 0.1 + 1e-9);
    }
    if (fix.in_shadow && !last.in_shadow) {
      EXPECT_LT(fix.bias.norm(), 0.1);
      directions.push_back(std::atan2(fix.bias.y(), fix.bias.x()));
    }
    last = fix;
  }
  ASSERT_EQ(directions.size(), 3u);
  EXPECT_NE(directions[0], directions[1]);
  EXPECT_NE(directions[1], directions[2]);
}

TEST(PaperField, NoiseDoesNotDependOnHowTheRobotIsSteered) {
  PaperFieldParameters parameters;
  parameters.shadow_border = -1e6;
  MotionParameters motion;
  motion.motion_model = MotionModel::kBicycle;
  motion = with(motion,
                "{odom_alpha1: 1e-4, odom_alpha2: 0, odom_alpha3: 0, odom_alpha4: 0, odom_alpha5: 0, "
                "odom_alpha6: 0}");
  PaperField left(parameters, motion), right(parameters, motion);
  std::vector<double> speed_errors;
  for (int k = 0; k < 500; ++k) {
    const double left_yaw = left.truth().yaw, right_yaw = right.truth().yaw;
    left.step({10.0, 0.3});
    right.step({10.0, -0.6});
    // The turn tells the speed: turn = v tan(steering) dt.
    const double left_speed = angle_difference(left.truth().yaw, left_yaw) / (std::tan(0.3) * 0.01);
    const double right_speed = angle_difference(right.truth().yaw, right_yaw) / (std::tan(-0.6) * 0.01);
    ASSERT_NEAR(left_speed, right_speed, 1e-11);
    speed_errors.push_back(left_speed - 10.0);
    const SimulatedFix a = left.fix();
    const SimulatedFix b = right.fix();
    const Eigen::Vector2d noise = a.position - left.truth().position();
    ASSERT_LT((noise - (b.position - right.truth().position())).norm(), 1e-12);
    ASSERT_GT(noise.norm(), 0.0);
  }
  EXPECT_TRUE(has_moments(speed_errors, 0.0, 1e-4 * 100.0 * 1.0 / 0.01));
}

TEST(PaperField, SeedsGiveOtherNoise) {
  PaperFieldParameters parameters;
  PaperField one(parameters, {}), same(parameters, {});
  parameters.seed = 2;
  PaperField other(parameters, {});
  const Eigen::Vector2d position = one.fix().position;
  EXPECT_EQ(same.fix().position, position);
  EXPECT_NE(other.fix().position, position);
}

TEST(PaperField, TargetsAreThoseOfTheControllersFile) {
  const YAML::Node file = YAML::LoadFile(package_directory() + "/config/paper_field/waypoint_controller.yaml");
  const std::vector<double> listed = file["targets"].as<std::vector<double>>();
  const PaperFieldParameters parameters;
  const std::vector<double> targets = parameters.targets();
  ASSERT_EQ(listed.size(), 16u);
  ASSERT_EQ(targets.size(), 16u);
  for (std::size_t i = 0; i < 16; ++i) EXPECT_NEAR(listed[i], targets[i], 1e-6);
  const Pose2 start = parameters.start();
  EXPECT_NEAR(start.x + std::cos(start.yaw) * 30.0 * std::sin(kPi / 8.0), targets[2], 1e-12);
  EXPECT_NEAR(start.y + std::sin(start.yaw) * 30.0 * std::sin(kPi / 8.0), targets[3], 1e-12);
}

TEST(PaperField, FilesDefaultsAreTheStructs) {
  const YAML::Node file = YAML::LoadFile(package_directory() + "/config/paper_field/simulator.yaml");
  PaperFieldParameters field;
  MotionParameters motion;
  ParameterReader reader(file, "", "", Layout::kTiered);
  reader.ignore("field");
  WithMotion with_motion{field, motion};
  EXPECT_TRUE(reader.read(with_motion).finish().empty());
  const PaperFieldParameters defaults;
  EXPECT_EQ(field.targets(), defaults.targets());
  EXPECT_NEAR(field.fix_shadow_sigma, defaults.fix_shadow_sigma, 1e-8);
  EXPECT_EQ(motion.motion_model, MotionModel::kBicycle);
}

}  // namespace
}  // namespace urban_gnss
