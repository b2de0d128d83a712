#include <gmock/gmock.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "pipeline_rig.hpp"
#include "urban_gnss_localization/pipeline/saved_state.hpp"

namespace urban_gnss {
namespace {

namespace fs = std::filesystem;
using Level = PipelineEvent::Level;
using testing::HasSubstr;

SavedState example() {
  SavedState state;
  state.stamp = Rig::at(20.0);
  state.map_frame = "map";
  state.base_link_frame = "base_link";
  state.datum = {33.0 + 1e-13, 130.0, 20.1};
  state.estimate.pose = {1.0 / 3.0, -2e5, 3.0};
  state.estimate.covariance << 0.3, 0.1, 0.01, 0.1, 0.4, 0.0, 0.01, 0.0, 0.05;
  return state;
}

std::string refusal(const std::string& text) {
  try {
    to_saved_state(text);
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return {};
}

/// A folder that is gone after the test.
struct Folder {
  fs::path path{fs::temp_directory_path() / ("saved_state_" + std::to_string(getpid()))};
  Folder() { fs::create_directory(path); }
  ~Folder() { fs::remove_all(path); }
  fs::path file(const std::string& text) const {
    std::ofstream(path / "state.json", std::ios::binary) << text;
    return path / "state.json";
  }
};

TEST(SavedState, ComesBackFromItsFileToTheLastDigit) {
  const Folder folder;
  const fs::path file = folder.path / "state.json";
  EXPECT_FALSE(read_state(file)) << "there is none yet";
  const SavedState state = example();
  write_state(file, state);
  const auto read = read_state(file);
  ASSERT_TRUE(read);
  EXPECT_EQ(read->stamp, state.stamp);
  EXPECT_EQ(read->map_frame, "map");
  EXPECT_EQ(read->base_link_frame, "base_link");
  EXPECT_EQ(read->datum, state.datum);
  EXPECT_EQ(read->estimate.pose.x, state.estimate.pose.x);
  EXPECT_EQ(read->estimate.pose.y, state.estimate.pose.y);
  EXPECT_NEAR(read->estimate.pose.yaw, 3.0, 1e-15);
  EXPECT_EQ(read->estimate.covariance, state.estimate.covariance);
  EXPECT_EQ(std::distance(fs::directory_iterator(folder.path), fs::directory_iterator()), 1) << "nothing beside it";
}

TEST(SavedState, EveryDamageIsToldAndNoneIsRead) {
  const std::string whole = to_text(example());
  for (std::size_t length = 0; length + 2 < whole.size(); ++length) {
    EXPECT_NE(refusal(whole.substr(0, length)), "") << length;
  }
  const nlohmann::json object = nlohmann::json::parse(whole);
  for (const auto& [name, value] : object.items()) {
    nlohmann::json spoilt = object;
    spoilt.erase(name);
    EXPECT_EQ(refusal(spoilt.dump()), name + " is missing");
    for (const nlohmann::json& bad : {nlohmann::json(nullptr), nlohmann::json::object(), nlohmann::json({1, "a"})}) {
      spoilt[name] = bad;
      EXPECT_EQ(refusal(spoilt.dump()), name + " is of another type");
    }
    if (!value.is_number_float()) continue;
    for (const char* bad : {"1e300", "-1e300", "NaN", "1e999"}) {
      std::string text = whole;
      text.replace(text.find(value.dump(), text.find(name)), value.dump().size(), bad);
      EXPECT_EQ(refusal(text) == "", name == "yaw_rad" && std::string(bad).back() == '0') << text;
    }
  }
  nlohmann::json spoilt = object;
  spoilt["covariance"][0] = -1.0;
  EXPECT_THAT(refusal(spoilt.dump()), HasSubstr("variance of x = -1"));
  spoilt["covariance"] = {1.0, 2.0};
  EXPECT_EQ(refusal(spoilt.dump()), "covariance has 2 numbers, must have 9");
  spoilt = object;
  spoilt["stamp_ns"] = -1;
  EXPECT_EQ(refusal(spoilt.dump()), "stamp_ns is negative");
  spoilt["format"] = "urban_gnss_localization state 2";
  EXPECT_EQ(refusal(spoilt.dump()), "format is another one");
  for (const char* other : {"", "\n", "[]", "3", "null", "{}", "x_m: 3\n"}) EXPECT_NE(refusal(other), "") << other;
}

TEST(SavedState, AFileThatIsNoneIsTold) {
  const Folder folder;
  for (const std::string& text : {std::string(), std::string("\0\0\0", 3), std::string(100000, '['),
                                  std::string(100000, ' ') + to_text(example())}) {
    EXPECT_THROW(read_state(folder.file(text)), std::invalid_argument) << text.size();
  }
  EXPECT_THROW(read_state(folder.path), std::invalid_argument) << "a folder";
  EXPECT_THROW(read_state("/dev/zero"), std::invalid_argument);
  EXPECT_EQ(state_file_fault(folder.path / "state.json"), "");
  EXPECT_THAT(state_file_fault("state.json"), HasSubstr("absolute"));
  EXPECT_THAT(state_file_fault(folder.path / "none" / "state.json"), HasSubstr("no such folder"));
  EXPECT_THAT(state_file_fault(folder.path), HasSubstr("no ordinary file"));
  EXPECT_THAT(state_file_fault(folder.path.string() + "/a\nb"), HasSubstr("control characters"));
}

TEST(SavedState, AFileThatCannotBeWrittenKeepsTheOldOne) {
  const Folder folder;
  EXPECT_THROW(write_state(folder.path / "none" / "state.json", example()), std::runtime_error);
  EXPECT_THROW(write_state("/dev/full", example()), std::runtime_error);
}

/// A drive of 20 s, and what it saves.
SavedState drive_and_save() {
  Rig before("{}");
  before.run(0.0, 20.0);
  const auto state = before.pipeline.state();
  EXPECT_TRUE(state);
  EXPECT_EQ(state->stamp, Rig::at(20.0));
  EXPECT_EQ(state->datum, before.pipeline.frame()->datum());
  return *state;
}

TEST(SavedState, IsGoneOnFromAtTheFirstOdometry) {
  const SavedState state = drive_and_save();
  Rig rig("{}");
  rig.pipeline.restore(state, {60.0, 2.0, 0.3});
  EXPECT_FALSE(rig.pipeline.initialized()) << "nobody knows how old it is";
  rig.drive(21.0);
  ASSERT_EQ(rig.pipeline.take_outputs().size(), 1u);
  EXPECT_EQ(rig.pipeline.frame()->datum(), state.datum);
  EXPECT_EQ(rig.fake->state.pose, state.estimate.pose);
  const Eigen::Matrix3d grown = rig.fake->state.covariance - state.estimate.covariance;
  EXPECT_LT((grown - Eigen::Matrix3d(Eigen::Vector3d(4.0, 4.0, 0.09).asDiagonal())).norm(), 1e-12);
  EXPECT_TRUE(has_event(rig.pipeline, Level::kInfo, "started from the saved state, 1 s old"));
}

TEST(SavedState, IsUnhealthyAndNotSavedAgainUntilAFixAgrees) {
  const SavedState state = drive_and_save();
  Rig rig("{}");
  rig.pipeline.restore(state, {});
  rig.run(20.1, 21.9, false);
  EXPECT_FALSE(rig.pipeline.report().healthy);
  EXPECT_THAT(rig.pipeline.report().reason, HasSubstr("no fix"));
  EXPECT_FALSE(rig.pipeline.state()) << "a state that lies must not become newer with every run";
  rig.run(22.0, 24.0);
  EXPECT_TRUE(rig.pipeline.report().healthy) << rig.pipeline.report().reason;
  EXPECT_TRUE(rig.pipeline.state());
}

TEST(SavedState, OneThatLiesIsLeftForTheFixes) {
  SavedState state = drive_and_save();
  state.estimate.pose.x += 300.0;
  Rig rig("{}");
  rig.pipeline.restore(state, {});
  for (int k = 201; k <= 600; ++k) {
    if (k % 10 == 0) rig.fix(0.1 * k);
    rig.drive(0.1 * k);
    const double error = (rig.fake->state.pose.position() - Rig::truth(0.1 * k).position()).norm();
    EXPECT_TRUE(error < 5.0 || !rig.pipeline.report().healthy) << 0.1 * k;
  }
  EXPECT_TRUE(rig.pipeline.report().healthy);
  EXPECT_LT((rig.fake->state.pose.position() - Rig::truth(60.0).position()).norm(), 5.0);
}

TEST(SavedState, IsLeftOutWithTheReason) {
  const SavedState state = drive_and_save();
  const auto after = [&](double time, const std::string& yaml, const std::string& reason) {
    Rig rig(yaml);
    rig.pipeline.restore(state, {60.0, 2.0, 0.2});
    rig.drive(time);
    EXPECT_FALSE(rig.pipeline.initialized()) << reason;
    EXPECT_TRUE(has_event(rig.pipeline, Level::kWarn, "saved state left out: " + reason)) << reason;
  };
  after(80.5, "{}", "it is 60.5 s old, at most 60 s");
  after(19.5, "{}", "it is 0.5 s later than the odometry");
  after(21.0, "{datum: [33.1, 130.0, 20.0]}", "its datum is another");
}

TEST(SavedState, YieldsToAPoseThatIsSetAndToAReset) {
  const SavedState state = drive_and_save();
  Rig told("{datum: [33.0, 130.0, 20.0]}");
  told.pipeline.restore(state, {});
  told.pipeline.set_pose({{5.0, 6.0, 0.0}, Eigen::Matrix3d::Identity()});
  told.drive(21.0);
  EXPECT_EQ(told.fake->state.pose.position(), Eigen::Vector2d(5.0, 6.0));
  Rig reset("{}");
  reset.pipeline.restore(state, {});
  reset.pipeline.reset("requested");
  reset.drive(21.0);
  EXPECT_FALSE(reset.pipeline.initialized());
}

TEST(SavedState, NothingIsSavedThatIsNotWorthIt) {
  Rig waiting("{}");
  EXPECT_FALSE(waiting.pipeline.state());
  Rig headless("{datum: [33.0, 130.0, 20.0], initialization_timeout: 5.0}");
  for (int k = 0; k < 100; ++k) {
    headless.pipeline.add_odometry({Rig::at(0.1 * k), {}, {}});
    if (k % 10 == 0) headless.pipeline.add_fix(raw_fix(Rig::at(0.1 * k), {0.0, 0.0}));
  }
  ASSERT_TRUE(headless.pipeline.initialized());
  EXPECT_FALSE(headless.pipeline.state()) << "no heading yet";
  Rig broken("{}");
  broken.run(0.0, 20.0);
  broken.fake->state.covariance(0, 0) = kNaN;
  EXPECT_FALSE(broken.pipeline.state());
}

}  // namespace
}  // namespace urban_gnss
