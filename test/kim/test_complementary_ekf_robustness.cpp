// The complementary filter where fixes and odometry contradict each other for long, stand still, or say little.

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <memory>
#include <optional>
#include <sstream>

#include "complementary_rig.hpp"
#include "matchers.hpp"
#include "urban_gnss_localization/parameters/parameter_reader.hpp"
#include "urban_gnss_localization/pipeline/localization_pipeline.hpp"

namespace urban_gnss {
namespace {

Eigen::Vector2d far_away(double) { return {80.0, 0.0}; }

// Lock-out: the estimate is 80 m off, every fix is rejected.
TEST(ComplementaryEkfLockout, AutomaticStartsAnewAfterTheTimeOut) {
  for (const char* mode : {"gated", "compensated"}) {
    Drive drive(1, std::string("{lockout_timeout: 20.0, mode: ") + mode + "}");
    drive.run(60.0);
    drive.bias = far_away;
    const double yaw_before = angle_difference(drive.filter.pose().yaw, drive.truth.yaw);
    drive.run(20.0);
    EXPECT_EQ(drive.last.decision, FixDecision::kRejectedGate) << mode;
    EXPECT_LT(drive.error_m(), 3.0) << mode;
    bool started_anew = false;
    drive.run(2.0, [&](const FixMeasurement&) {
      started_anew = started_anew || drive.last.decision == FixDecision::kInflated;
    });
    EXPECT_TRUE(started_anew) << mode;
    EXPECT_NEAR(drive.error_m(), 80.0, 5.0) << mode;
    EXPECT_NEAR(angle_difference(drive.filter.pose().yaw, drive.truth.yaw), yaw_before, 0.15) << mode;
    drive.run(10.0);
    EXPECT_FALSE(is_rejected(drive.last.decision)) << mode;
  }
}

TEST(ComplementaryEkfLockout, DeadReckoningBelievesTheOdometry) {
  for (const char* mode : {"gated", "compensated"}) {
    Drive drive(2, std::string("{lockout_policy: dead_reckoning, mode: ") + mode + "}");
    drive.run(60.0);
    drive.bias = far_away;
    drive.run(300.0, [&](const FixMeasurement&) {
      ASSERT_TRUE(is_rejected(drive.last.decision)) << mode << " at " << drive.time_s;
    });
    EXPECT_LT(drive.error_m(), 30.0) << mode << ": drift of 300 s";
    drive.bias = [&](double) { return Eigen::Vector2d(drive.filter.pose().position() - drive.truth.position()); };
    drive.run(1.0);
    EXPECT_FALSE(is_rejected(drive.last.decision)) << mode << ": a fix that agrees ends it";
  }
}

// After a blackout some fixes that agree with each other, but are wrong, must not take the estimate with them.
TEST(ComplementaryEkfLockout, ShortClusterAfterABlackoutCapturesNothing) {
  for (const char* mode : {"gated", "compensated"}) {
    Drive drive(3, std::string("{mode: ") + mode + "}");
    drive.run(60.0);
    drive.bias = far_away;
    drive.run(10.0);
    drive.run_without_fixes(30.0);  // longer than the time-out
    drive.run(10.0);
    EXPECT_LT(drive.error_m(), 10.0) << mode;
    EXPECT_TRUE(is_rejected(drive.last.decision)) << mode;
  }
}

TEST(ComplementaryEkfLockout, BiasThatNeverEndsIsGivenUp) {
  const char* const kSteady = "{fix_bias_time: 1.0e+9, bias_open_timeout: 60.0, lockout_policy: ";
  const auto open_for = [&](const std::string& policy) {
    Drive drive(4, kSteady + policy + "}");
    drive.run(60.0);
    drive.bias = [](double) { return Eigen::Vector2d(30.0, 0.0); };
    int open = 0;
    drive.run(100.0, [&](const FixMeasurement&) { open += drive.filter.is_bias_open(); });
    return open;
  };
  EXPECT_NEAR(open_for("automatic"), 60, 10);
  EXPECT_GT(open_for("dead_reckoning"), 95);
}

// A gate whose covariance grows while it rejects lets everything through in the end.
TEST(ComplementaryEkfLockout, TestsDoNotWidenWhileFixesAreDoubted) {
  const auto smallest_after = [](const char* horizon) {
    Drive drive(5, std::string("{mode: gated, lockout_policy: dead_reckoning, detection_horizon: ") + horizon + "}");
    drive.run(60.0);
    drive.bias = far_away;
    drive.run(200.0);
    return drive.filter.smallest_detectable_jump_m();
  };
  EXPECT_LT(smallest_after("10.0"), 12.0);
  EXPECT_GT(smallest_after("1000.0"), 2.0 * smallest_after("10.0"));
}

// Parked, the fix drifts: an error of 2.5 m and 30 s, declared as 3 m.
TEST(ComplementaryEkfParked, PoseDoesNotCreepAndSigmaStaysHonest) {
  constexpr int kSeeds = 40;
  double nees = 0.0;
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    Drive drive(seed);
    drive.speed_mps = 0.0;
    drive.filter.initialize(pose_with_sigma({0.0, 0.0, 0.0}, 3.0, 0.1));
    Eigen::Vector2d error(2.5 * draw_normal(drive.engine), 2.5 * draw_normal(drive.engine));
    const auto park = [&](int seconds) {
      double creep = 0.0;
      const Pose2 start = drive.filter.pose();
      const double rho = std::exp(-1.0 / 30.0);
      for (int k = 0; k < seconds; ++k) {
        for (int step = 0; step < 10; ++step) drive.step();
        const double x = draw_normal(drive.engine);
        const double y = draw_normal(drive.engine);
        error = rho * error + std::sqrt(1.0 - rho * rho) * 2.5 * Eigen::Vector2d(x, y);
        FixMeasurement fix;
        fix.position = drive.truth.position() + error;
        fix.covariance = isotropic(3.0);
        fix.time_s = drive.time_s;
        drive.filter.correct(fix);
        creep = std::max(creep, (drive.filter.pose().position() - start.position()).norm());
      }
      return creep;
    };
    park(1200);
    EXPECT_LT(park(120), 0.5) << "seed " << seed;
    const Eigen::Vector2d pose_error = drive.filter.pose().position() - drive.truth.position();
    const Eigen::Matrix2d covariance = drive.filter.estimate().covariance.topLeftCorner<2, 2>();
    nees += pose_error.dot(covariance.ldlt().solve(pose_error)) / kSeeds;
  }
  RecordProperty("nees", std::to_string(nees));
  EXPECT_LT(nees, 6.0) << "sigma is at most 1.7 times too small";
}

/// Rows of a recording's CSV as numbers.
std::vector<std::vector<double>> read_csv(const std::string& file) {
  std::ifstream in(file);
  std::vector<std::vector<double>> rows;
  std::string line;
  std::getline(in, line);
  while (std::getline(in, line)) {
    std::vector<double> row;
    std::istringstream cells(line);
    for (std::string cell; std::getline(cells, cell, ',');) row.push_back(cell.empty() ? 0.0 : std::stod(cell));
    rows.push_back(row);
  }
  return rows;
}

TEST(ComplementaryEkfParked, RecordingDoesNotCreep) {
  const char* const folder = std::getenv("URBAN_GNSS_DATA");
  if (!folder) GTEST_SKIP() << "URBAN_GNSS_DATA is not set";
  const auto rows = read_csv(std::string(folder) + "/hk_tst_20200603_static/gnss.csv");
  if (rows.empty()) GTEST_SKIP() << "no hk_tst_20200603_static in " << folder;
  LocalizationPipeline pipeline({}, std::make_unique<ComplementaryEkf>(ComplementaryEkfParameters()));
  std::vector<LocalizationOutput> outputs;
  for (const std::vector<double>& row : rows) {
    ASSERT_GT(row.size(), 10u);
    RawFix fix;
    fix.stamp = from_seconds(row[0]);
    fix.position = {row[1], row[2], row[3]};
    fix.covariance << row[7], row[8], 0.0, row[8], row[9], 0.0, 0.0, 0.0, row[10];
    fix.covariance_type = CovarianceType::kKnown;
    OdometrySample standing;
    standing.stamp = fix.stamp;
    pipeline.add_odometry(standing);
    pipeline.add_fix(fix);
    for (const LocalizationOutput& output : pipeline.take_outputs()) outputs.push_back(output);
  }
  ASSERT_GT(outputs.size(), 50u);
  const auto creep_between = [&](double from_s, double to_s) {
    double creep = 0.0;
    std::optional<Eigen::Vector2d> from;
    for (const LocalizationOutput& output : outputs) {
      const double parked_s = to_seconds(output.stamp) - rows.front()[0];
      if (parked_s < from_s || parked_s > to_s) continue;
      if (!from) from = output.estimate.pose.position();
      creep = std::max(creep, (output.estimate.pose.position() - *from).norm());
    }
    return creep;
  };
  // The 156 s for which the recording has odometry, from the start after 60 s; and the fixes after that.
  const double early = creep_between(0.0, 156.0);
  const double late = creep_between(300.0, 1e9);
  RecordProperty("creep_early_m", std::to_string(early));
  RecordProperty("creep_late_m", std::to_string(late));
  EXPECT_LT(early, 0.5);
  EXPECT_LT(late, 0.5);
  EXPECT_GT(std::sqrt(outputs.back().estimate.covariance(0, 0)), 1.0) << "a parked receiver does not learn its bias";
}

// Encoders that say nothing while the robot drives: the estimate must not hold its place.
TEST(ComplementaryEkfParked, DeadEncoderIsNoStandstill) {
  Drive drive(6);
  drive.run(60.0);
  const Eigen::Vector2d stopped = drive.filter.pose().position();
  drive.speed_mps = 0.0;
  drive.bias = [](double since) { return Eigen::Vector2d(1.5 * since, 0.0); };
  drive.run(200.0);
  EXPECT_GT((drive.filter.pose().position() - stopped).norm(), 150.0);
}

TEST(ComplementaryEkfStart, UnknownHeadingIsFoundFromMotion) {
  for (const double yaw : {0.0, 1.6, 3.1, -2.0}) {
    Drive drive(7);
    drive.truth.yaw = yaw;
    PoseEstimate start = pose_with_sigma({0.0, 0.0, 0.0}, 2.0, kPi / std::sqrt(3.0));
    drive.filter.initialize(start);
    EXPECT_GT(drive.filter.health().heading_sigma_rad, 1.5);
    drive.run(60.0);
    EXPECT_NEAR(angle_difference(drive.filter.pose().yaw, drive.truth.yaw), 0.0, 0.15) << yaw;
    EXPECT_LT(drive.filter.health().heading_sigma_rad, 0.2) << yaw;
    EXPECT_LT(drive.error_m(), 3.0) << yaw;
  }
}

/// What a drive through everything leaves behind; differs where anything in it does.
std::string trace(const std::string& yaml) {
  std::ostringstream text;
  text.precision(17);
  const auto drive_through = [&](const std::string& mode) {
    const YAML::Node node = YAML::Load(yaml);
    // With what the paper's experiment has no use for.
    YAML::Node merged = YAML::Load(
        "{correlation_distance: 1.0, correlation_time: 3.0, common_error_share: 0.7, common_error_min: 0.7, "
        "common_error_max: 1.2, reacquisition_gap: 5.0, reacquisition_sigma: 20.0}");
    if (!mode.empty()) merged["mode"] = mode;
    for (const auto& entry : node) merged[entry.first.as<std::string>()] = entry.second;
    YAML::Emitter out;
    out << YAML::Flow << merged;
    Drive drive(8, out.c_str());
    const auto note = [&](const FixMeasurement&) {
      text << drive.filter.pose().x << ' ' << drive.filter.smallest_detectable_jump_m() << ' '
           << drive.filter.error_covariance()(2, 2) << ' ' << drive.filter.estimate().covariance(0, 0) << ' '
           << to_string(drive.last.decision) << drive.last.reason << '\n';
    };
    drive.run(60.0, note);
    for (const Eigen::Vector2d& bias : {Eigen::Vector2d(15.0, 0.0), Eigen::Vector2d(0.0, -30.0)}) {
      drive.bias = [bias](double) { return bias; };
      drive.run(160.0, note);
      drive.run_without_fixes(7.0);
    }
    drive.bias = {};
    drive.run(30.0, note);
    drive.bias = [](double since) { return Eigen::Vector2d(0.2 * since, 0.0); };
    drive.run(40.0, note);
    drive.bias = far_away;
    drive.run(12.0, note);
    drive.run_without_fixes(3.0);
    drive.run(30.0, note);
    drive.bias = {};
    drive.speed_mps = 0.0;
    for (int k = 0; k < 60; ++k) {
      for (int step = 0; step < 5; ++step) drive.step();
      FixMeasurement quiet = drive.make_fix();
      quiet.position = drive.filter.pose().position() + Eigen::Vector2d(0.05 * (k % 7), 0.0);
      drive.last = drive.filter.correct(quiet);
      note(quiet);
    }
  };
  drive_through("");
  drive_through("gated");
  return text.str();
}

TEST(ComplementaryEkfParameters, EachHasAnEffect) {
  const std::string reference = trace("{}");
  EXPECT_TRUE(trace("{}") == reference) << "the same input gives the same output";
  ParameterList list;
  list.add(published_complementary_ekf());
  for (const ListedParameter& listed : list.parameters()) {
    const std::string& name = listed.name;
    const std::string& value = listed.value;
    std::string other;
    if (name == "wheelbase") continue;  // of a bicycle: below
    if (name == "mode") {
      other = "standard";
    } else if (name == "lockout_policy") {
      other = "dead_reckoning";
    } else if (value == "true" || value == "false") {
      other = value == "true" ? "false" : "true";
    } else if (name == "close_count") {
      other = std::to_string(std::stoi(value) / 2);
    } else if (name == "gate_probability" || name == "close_probability") {
      other = "0.6";
    } else if (name.rfind("common_error", 0) == 0) {
      other = name == "common_error_min" ? "0.9" : "1.0";
    } else if (name == "reacquisition_gap") {
      other = "90.0";
    } else if (name.rfind("correlation_", 0) == 0) {
      other = "90.0";
    } else if (name == "fix_noise_max_inflation") {
      other = "1.01";
    } else if (name == "motion_model") {
      other = "bicycle";
    } else if (std::stod(value) == 0.0) {
      other = "0.001";
    } else {
      other = std::to_string(0.5 * std::stod(value));
    }
    EXPECT_TRUE(trace("{" + name + ": " + other + "}") != reference) << name << ": " << other;
  }
  EXPECT_TRUE(trace("{motion_model: bicycle, wheelbase: 2.0}") != trace("{motion_model: bicycle}"));
}

TEST(ComplementaryEkfParameters, BadOnesAreNamed) {
  const YAML::Node map = YAML::Load(
      "{mode: bold, gate_probability: 1.0, close_count: 0, fix_bias_time: 0.0, lockout_policy: never, "
      "speed_scale_walk: "
      "-1.0, fix_bias_tim: 3.0}");
  ComplementaryEkfParameters parameters;
  ParameterReader reader(map);
  reader.read(parameters);
  EXPECT_EQ(reader.finish().size(), 7u);
}

}  // namespace
}  // namespace urban_gnss
