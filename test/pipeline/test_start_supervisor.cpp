#include "pipeline_rig.hpp"
#include "urban_gnss_localization/pipeline/start_supervisor.hpp"

namespace urban_gnss {
namespace {

/// A supervisor with the odometry of the rig's robot at 10 Hz, whose fixes have no error.
struct Supervised {
  static constexpr double kSigma_m = 1.0;
  StartSupervisor supervisor;
  OdometryHistory history{100.0};
  Eigen::Vector2d antenna{0.7, -0.4};
  std::vector<PipelineEvent> events;
  double time{0.0};

  explicit Supervised(const StartParameters& parameters = {}) : supervisor(parameters) {}

  void drive_to(double end, const Twist2& twist = Rig::kTwist) {
    for (; time <= end + 1e-9; time += 0.1) history.add(Rig::at(time), twist);
  }
  LocalFix fix(const Eigen::Vector2d& error = {0.0, 0.0}) const {
    const Pose2 base = compose(Rig::truth(0.0), *history.pose_at(history.latest()));
    return {history.latest(), transform_point(base, antenna) + error, isotropic(kSigma_m)};
  }
  std::optional<Start> find_start() { return supervisor.find_start({fix(), history, antenna}); }
  /// By a fix that is `distance_m` from where the localizer predicts the antenna.
  std::optional<Start> find_restart(double distance_m, bool is_contradicted = false) {
    const LocalFix at_antenna = fix();
    return supervisor.find_restart({at_antenna, history, antenna},
                                   at_antenna.position + Eigen::Vector2d(0.0, distance_m), is_contradicted, events);
  }
};

Start given_start() { return {pose_with_sigma({}, 1.0, 0.1), "a test"}; }

TEST(StartSupervisor, InitialPoseIsGivenUntilItIsUsed) {
  StartParameters parameters;
  parameters.initial_pose = {3.0, 4.0, 7.0};
  parameters.initial_position_sigma = 2.0;
  parameters.initial_heading_sigma = 0.5;
  StartSupervisor supervisor(parameters);
  ASSERT_TRUE(supervisor.given());
  EXPECT_TRUE(near(supervisor.given()->pose, {3.0, 4.0, wrap_angle(7.0)}, 1e-12));
  EXPECT_EQ(supervisor.given()->covariance.diagonal(), Eigen::Vector3d(4.0, 4.0, 0.25));
  supervisor.note(given_start());
  EXPECT_FALSE(supervisor.given());
  EXPECT_TRUE(supervisor.has_started());
  supervisor.reset();
  EXPECT_TRUE(supervisor.given());
  EXPECT_FALSE(supervisor.has_started());
  EXPECT_FALSE(StartSupervisor(StartParameters{}).given());
  EXPECT_THROW(supervisor.give(pose_with_sigma({kNaN, 0.0, 0.0}, 1.0, 1.0)), std::invalid_argument);
  EXPECT_TRUE(near(supervisor.given()->pose, {3.0, 4.0, wrap_angle(7.0)}, 1e-12));
}

TEST(StartSupervisor, StartIsTheBaseAtTheLatestOdometry) {
  Supervised robot;
  std::optional<Start> start;
  for (int second = 0; second < 60 && !start; ++second) {
    robot.drive_to(second);
    const LocalFix fix = robot.fix();
    robot.drive_to(second + 0.5);  // it comes late
    start = robot.supervisor.find_start({fix, robot.history, robot.antenna});
  }
  ASSERT_TRUE(start);
  EXPECT_TRUE(near(start->estimate.pose, *robot.history.pose_at(robot.history.latest()), 1e-6));
  EXPECT_TRUE(start->has_heading);
  EXPECT_GE(start->estimate.covariance(0, 0), 1.0) << "the fixes' common error is in it";
}

TEST(StartSupervisor, FixesOfOneSecondCountAsOne) {
  for (const double interval_s : {1.0, 0.1}) {
    Supervised robot;
    int fixes = 0;
    for (double time = 0.0; time < 60.0 && !robot.supervisor.has_started(); time += interval_s) {
      robot.drive_to(time);
      ++fixes;
      if (const auto start = robot.find_start()) robot.supervisor.note(*start);
    }
    EXPECT_TRUE(robot.supervisor.has_started());
    const double needed_s = fixes * interval_s;
    EXPECT_NEAR(needed_s, 6.0, 3.0) << interval_s << " s apart: more fixes do not make it sooner";
  }
}

TEST(StartSupervisor, ParkedRobotHasItsHeadingAsSoonAsItMoves) {
  StartParameters parameters;
  parameters.heading.initialization_timeout = 20.0;
  Supervised robot(parameters);
  for (int second = 0; second <= 20; ++second) {
    robot.drive_to(second, {});
    const auto start = robot.find_start();
    EXPECT_EQ(start.has_value(), second == 20) << second;
    if (!start) continue;
    EXPECT_FALSE(start->has_heading);
    EXPECT_GE(start->estimate.covariance(2, 2), kPi * kPi / 3.0 - 1e-12);
    robot.supervisor.note(*start);
  }
  ASSERT_TRUE(robot.supervisor.has_started());
  int restarts = 0;
  for (int second = 21; second <= 60; ++second) {
    robot.drive_to(second);
    const auto start = robot.find_restart(0.0);
    if (!start) continue;
    ++restarts;
    EXPECT_EQ(start->fix_use, "used for a start with heading");
    EXPECT_LT(std::sqrt(start->estimate.covariance(2, 2)), 0.2);
    robot.supervisor.note(*start);
  }
  EXPECT_EQ(restarts, 1);
}

TEST(StartSupervisor, IsLostByFarFixesAlone) {
  // 50 m, and 3 standard deviations of a distance whose variance is twice that of an axis.
  const double limit = 50.0 + 3.0 * std::sqrt(2.0) * Supervised::kSigma_m;
  for (const auto& [distance_m, exception_m, restarts] :
       {std::tuple{limit + 0.1, limit + 0.1, true}, {limit - 0.1, limit - 0.1, false}, {limit + 0.1, 0.0, false}}) {
    Supervised robot;
    robot.drive_to(0.0);
    robot.supervisor.note(given_start());
    std::optional<double> restarted;
    for (int second = 0; second <= 30 && !restarted; ++second) {
      robot.drive_to(second);
      const bool is_exception = second % 8 == 7;
      if (robot.find_restart(is_exception ? exception_m : distance_m)) restarted = second;
    }
    EXPECT_EQ(restarted.has_value(), restarts) << distance_m << ' ' << exception_m;
    EXPECT_EQ(robot.supervisor.is_lost(), restarts);
    EXPECT_EQ(robot.events.size(), restarts ? 1u : 0u);
    if (restarts) {
      EXPECT_EQ(restarted, 10.0) << "lost_timeout";
    }
  }
}

TEST(StartSupervisor, PlaceThatIsLostIsFoundFromWhatComesAfter) {
  Supervised robot;
  robot.supervisor.lose_place();
  EXPECT_FALSE(robot.supervisor.is_lost()) << "there was none";
  robot.supervisor.note(given_start());
  robot.supervisor.lose_place();
  EXPECT_TRUE(robot.supervisor.is_lost());
  EXPECT_FALSE(robot.supervisor.has_started());
  for (int second = 0; second < 60 && !robot.supervisor.has_started(); ++second) {
    robot.drive_to(second);
    if (second == 3) robot.supervisor.lose_place();  // what fixes said until now is forgotten
    const auto start = robot.find_start();
    if (second <= 6) {
      EXPECT_FALSE(start) << second;
    }
    if (start) robot.supervisor.note(*start);
  }
  EXPECT_TRUE(robot.supervisor.has_started());
  EXPECT_FALSE(robot.supervisor.is_lost());
}

}  // namespace
}  // namespace urban_gnss
