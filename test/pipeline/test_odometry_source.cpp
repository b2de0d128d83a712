// Odometry that contradicts itself, and what moves the robot then.

#include <gtest/gtest.h>

#include <string>

#include "odometry_drive.hpp"
#include "urban_gnss_localization/pipeline/odometry_source.hpp"

namespace urban_gnss {
namespace {

using Change = std::function<void(OdometrySample&, double time_s)>;

struct Result {
  double error_m{0.0};       ///< of the path, where it began right
  double worst_step_m{0.0};  ///< by which a step was wrong after the first 10 s of motion
  std::vector<std::string> warnings;
  std::vector<std::string> infos;
  std::string complaint;  ///< at the end
  double complained_s{0.0};
  std::size_t steps{0};
};

enum class Witness { kNone, kFixes, kVelocities };

Result run(const OdometryDrive& drive, const Change& change, Witness witness = Witness::kNone) {
  RandomEngine engine = make_engine(7);
  OdometrySource source;
  std::vector<PipelineEvent> events;
  Result result;
  std::optional<OdometryDrive::Moment> last;
  for (const OdometryDrive::Moment& now : drive.moments()) {
    OdometrySample told = now.told;
    change(told, now.time_s);
    EXPECT_EQ(OdometrySource::fault_of(told), "");
    const OdometrySample step = source.resolve(told, events);
    EXPECT_TRUE(is_finite(step.pose));
    const double whole_s = std::floor(now.time_s + 1e-6);
    const bool is_second = last && std::floor(last->time_s + 1e-6) < whole_s;
    if (witness == Witness::kFixes && is_second) {
      const Eigen::Vector2d noise(draw_normal(engine), draw_normal(engine));
      source.add_fix(told.stamp, now.truth.position() + noise, events);
    }
    if (witness == Witness::kVelocities && is_second) {
      const Twist2 twist = drive.motion(now.time_s);
      const Pose2 turn{0.0, 0.0, now.truth.yaw};
      source.add_velocity(told.stamp, transform_point(turn, {twist.speed_mps, twist.lateral_mps}), events);
    }
    if (last) {
      const double step_s = now.time_s - last->time_s;
      const Pose2 moved = move(last->truth, step.twist, step_s);
      const double off_m = (moved.position() - now.truth.position()).norm();
      if (now.time_s > 15.0) {
        result.worst_step_m = std::max(result.worst_step_m, off_m);
        result.error_m += off_m;
      }
      if (!source.complaint().empty()) result.complained_s += step_s;
    }
    last = now;
    ++result.steps;
  }
  for (const PipelineEvent& event : events) {
    (event.level == PipelineEvent::Level::kInfo ? result.infos : result.warnings).push_back(event.text);
  }
  result.complaint = source.complaint();
  return result;
}

bool says(const std::vector<std::string>& texts, const std::string& part) {
  for (const std::string& text : texts) {
    if (text.find(part) != std::string::npos) return true;
  }
  return false;
}

const double kRates[] = {1.0, 2.0, 10.0, 50.0, 200.0};

TEST(OdometrySource, SaysNothingOfAHealthyOneAtAnyRate) {
  for (const double rate_hz : kRates) {
    const Result result = run(
        {rate_hz}, [](OdometrySample&, double) {}, Witness::kFixes);
    EXPECT_TRUE(result.warnings.empty()) << rate_hz << ": " << result.warnings[0];
    EXPECT_TRUE(result.infos.empty());
    EXPECT_EQ(result.complained_s, 0.0);
  }
}

TEST(OdometrySource, HealthyIsAlsoWhoStopsTurnsOnTheSpotBacksUpAndSlidesSideways) {
  OdometryDrive drive;
  drive.motion = [](double time_s) {
    switch (static_cast<int>(time_s / 5.0) % 6) {
      case 0: return Twist2{};
      case 1: return Twist2{1.5, 0.0};
      case 2: return Twist2{0.0, 1.0};
      case 3: return Twist2{-1.0, 0.2};
      case 4: return Twist2{0.0, 0.0, 1.0};
      default: return Twist2{0.5, -0.8, -0.5};
    }
  };
  for (const double rate_hz : kRates) {
    drive.rate_hz = rate_hz;
    if (rate_hz == 1.0) continue;  // a twist once a second says little of such a drive
    const Result result = run(drive, [](OdometrySample&, double) {});
    EXPECT_TRUE(result.warnings.empty()) << rate_hz << ": " << result.warnings[0];
  }
}

// Poses are rounded to encoder ticks and stamps jitter: at 200 Hz the increments alone say nothing.
TEST(OdometrySource, RoundedPosesAndJitteringStampsAreHealthy) {
  RandomEngine engine = make_engine(3);
  OdometryDrive drive{200.0};
  const Result result = run(drive, [&](OdometrySample& told, double) {
    told.pose.x = 0.005 * std::round(told.pose.x / 0.005);
    told.pose.y = 0.005 * std::round(told.pose.y / 0.005);
    told.stamp += from_seconds(0.004 * draw_uniform(engine) - 0.002);
  });
  EXPECT_TRUE(result.warnings.empty()) << result.warnings[0];
}

// A skidding robot (a Husky) on a gentle way: its yaw rate is off by 0.1 rad/s now and then, and as far round as its pose.
TEST(OdometrySource, AYawRateThatIsNoisyButTurnsAsFarAsThePoseIsHealthy) {
  RandomEngine engine = make_engine(5);
  OdometryDrive drive{10.0};
  drive.motion = [](double time_s) { return Twist2{1.0, 0.06 * std::sin(0.3 * time_s)}; };
  double noise_radps = 0.0;
  int last_block = -1;
  const Result result = run(drive, [&](OdometrySample& told, double time_s) {
    const int block = static_cast<int>(time_s / 0.5);
    if (block != last_block) noise_radps = 0.1 * draw_normal(engine);
    last_block = block;
    told.twist.yaw_rate_radps += noise_radps;
  });
  EXPECT_TRUE(result.warnings.empty()) << result.warnings[0];
  EXPECT_EQ(result.complained_s, 0.0);
}

struct Mistake {
  const char* name;
  Change change;
  const char* cause;
};

const Change kTimes(double speed, double yaw_rate) {
  return [=](OdometrySample& told, double) {
    told.twist.speed_mps *= speed;
    told.twist.lateral_mps *= speed;
    told.twist.yaw_rate_radps *= yaw_rate;
  };
}

void to_odometry_frame(OdometrySample& told, double) {
  const Eigen::Vector2d v = transform_point({0.0, 0.0, told.pose.yaw}, {told.twist.speed_mps, told.twist.lateral_mps});
  told.twist.speed_mps = v.x();
  told.twist.lateral_mps = v.y();
}

const Mistake kMistakesOfTheTwist[] = {
    {"zero", kTimes(0.0, 0.0), "the twist is not filled in"},
    {"no yaw rate", kTimes(1.0, 0.0), "no yaw rate"},
    {"odometry's frame", to_odometry_frame, "in the odometry's frame"},
    {"mm/s", kTimes(1000.0, 1.0), "mm/s"},
    {"cm/s", kTimes(100.0, 1.0), "cm/s"},
    {"km/h", kTimes(3.6, 1.0), "km/h"},
    {"mph", kTimes(2.2369, 1.0), "miles per hour"},
    {"knots", kTimes(1.9438, 1.0), "knots"},
    {"sign", kTimes(-1.0, 1.0), "sign of the speed"},
    {"degrees", kTimes(1.0, 57.296), "degrees per second"},
    {"sign of the yaw rate", kTimes(1.0, -1.0), "sign of the yaw rate"},
    {"swapped",
     [](OdometrySample& told, double) {
       told.twist.lateral_mps = told.twist.speed_mps;
       told.twist.speed_mps = 0.0;
     },
     "swapped"},
};

TEST(OdometrySource, NamesTheMistakeOfATwistAndTakesThePose) {
  for (const Mistake& mistake : kMistakesOfTheTwist) {
    for (const double rate_hz : {2.0, 20.0, 100.0}) {
      for (const Witness witness : {Witness::kFixes, Witness::kVelocities}) {
        const Result result = run({rate_hz}, mistake.change, witness);
        EXPECT_TRUE(says(result.warnings, mistake.cause))
            << mistake.name << ' ' << rate_hz << (result.warnings.empty() ? "" : result.warnings[0]);
        EXPECT_LT(result.worst_step_m, 0.05) << mistake.name << ' ' << rate_hz;
        EXPECT_EQ(result.complaint, "") << mistake.name << ' ' << rate_hz << ": the witness says that it is the pose";
        EXPECT_LE(result.warnings.size(), 3u);
      }
    }
  }
}

TEST(OdometrySource, WithoutAWitnessAMistakeIsAComplaintButForATwistOfZero) {
  for (const Mistake& mistake : kMistakesOfTheTwist) {
    const Result result = run({}, mistake.change);
    EXPECT_LT(result.worst_step_m, 0.05) << mistake.name;
    const bool is_zero = std::string(mistake.cause).find("not filled") != std::string::npos ||
                         std::string(mistake.cause).find("no yaw rate") != std::string::npos;
    EXPECT_EQ(result.complaint.empty(), is_zero) << mistake.name;
  }
}

TEST(OdometrySource, AFactorThatIsNoUnitIsLeftToTheWitness) {
  for (const Witness witness : {Witness::kNone, Witness::kFixes, Witness::kVelocities}) {
    const Result wrong_twist = run({}, kTimes(1.6, 1.0), witness);
    EXPECT_TRUE(says(wrong_twist.warnings, "factor of 1.6"));
    EXPECT_EQ(wrong_twist.complaint.empty(), witness != Witness::kNone);
    const Result wrong_pose = run(
        {}, [](OdometrySample& told, double) { told.pose.x *= 1.6, told.pose.y *= 1.6; }, witness);
    EXPECT_TRUE(says(wrong_pose.warnings, "factor of 0.6"));
    EXPECT_LT(wrong_pose.worst_step_m, 0.05) << "the twist";
    EXPECT_EQ(wrong_pose.complaint.empty(), witness != Witness::kNone);
  }
}

TEST(OdometrySource, APoseInMillimetresOrAtRestLeavesTheTwist) {
  const Result in_mm = run(
      {}, [](OdometrySample& told, double) { told.pose.x *= 1000.0, told.pose.y *= 1000.0; }, Witness::kFixes);
  EXPECT_TRUE(says(in_mm.warnings, "pose in mm"));
  EXPECT_LT(in_mm.worst_step_m, 0.05);
  EXPECT_EQ(in_mm.complaint, "");
  const Result at_rest = run({}, [](OdometrySample& told, double) { told.pose = {}; });
  EXPECT_TRUE(says(at_rest.warnings, "the pose is not filled in"));
  EXPECT_LT(at_rest.worst_step_m, 0.05);
  EXPECT_EQ(at_rest.complaint, "");
}

TEST(OdometrySource, TwistThatIsNotDeclaredIsThePosesIncrement) {
  for (const double rate_hz : kRates) {
    const Result result = run({rate_hz}, [](OdometrySample& told, double) {
      told.has_twist = false;
      told.twist = {};
    });
    EXPECT_TRUE(result.warnings.empty());
    EXPECT_TRUE(says(result.infos, "declares no twist"));
    EXPECT_LT(result.worst_step_m, 1e-6) << rate_hz;
  }
}

TEST(OdometrySource, MissingPoseIsIntegratedFromTheTwist) {
  OdometrySource source;
  std::vector<PipelineEvent> events;
  Pose2 expected;
  for (int k = 0; k <= 100; ++k) {
    OdometrySample told{from_seconds(0.1 * k), {kPi, kPi, kPi}, {1.0, 0.2}};
    told.has_pose = false;
    told.pose = {std::nan(""), std::nan(""), std::nan("")};
    EXPECT_EQ(OdometrySource::fault_of(told), "");
    const OdometrySample step = source.resolve(told, events);
    if (k > 0) {
      expected = move(expected, {1.0, 0.2}, 0.1);
      EXPECT_LT((step.pose.position() - expected.position()).norm(), 1e-6);
    }
    EXPECT_EQ(step.twist.speed_mps, 1.0);
  }
  ASSERT_EQ(events.size(), 1u);
  EXPECT_NE(events[0].text.find("no pose"), std::string::npos);
  OdometrySample nothing;
  nothing.has_pose = nothing.has_twist = false;
  EXPECT_NE(OdometrySource::fault_of(nothing), "");
}

// The wheels' node is restarted: its pose begins at 0 again.
TEST(OdometrySource, PoseThatIsResetIsNoMotion) {
  for (const double rate_hz : kRates) {
    for (const bool has_twist : {true, false}) {
      Pose2 origin;
      bool was_reset = false;
      const Result result = run({rate_hz}, [&](OdometrySample& told, double time_s) {
        if (!was_reset && time_s >= 60.0) {
          origin = told.pose;
          was_reset = true;
        }
        told.pose = relative_pose(origin, told.pose);
        told.has_twist = has_twist;
        if (!has_twist) told.twist = {};
      });
      EXPECT_TRUE(says(result.warnings, "was it reset?")) << rate_hz;
      EXPECT_EQ(result.warnings.size(), 1u) << rate_hz;
      EXPECT_LT(result.worst_step_m, 0.1 + 0.5 / rate_hz) << rate_hz << has_twist;
      EXPECT_EQ(result.complaint, "");
    }
  }
}

TEST(OdometrySource, TwistThatIsTheCommandIsFoundOutWhileItCoasts) {
  const Result result = run({}, [](OdometrySample& told, double time_s) {
    if (std::fmod(time_s, 20.0) > 12.0) told.twist = {};
  });
  EXPECT_TRUE(says(result.warnings, "not filled in"));
  EXPECT_LT(result.worst_step_m, 0.11);
}

TEST(OdometrySource, SlowMessagesMoveByThePoseBetweenThem) {
  OdometryDrive drive{1.0};
  drive.motion = [](double time_s) { return Twist2{1.5 + 1.5 * std::sin(time_s), 0.5 * std::cos(0.7 * time_s)}; };
  EXPECT_LT(run(drive, [](OdometrySample&, double) {}).worst_step_m, 1e-6);
  drive.rate_hz = 10.0;
  EXPECT_GT(run(drive, [](OdometrySample&, double) {}).worst_step_m, 1e-3) << "the twist";
}

}  // namespace
}  // namespace urban_gnss
