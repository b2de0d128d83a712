#include "pipeline_rig.hpp"
#include "urban_gnss_localization/pipeline/fix_queue.hpp"

namespace urban_gnss {
namespace {

const LocalFrame kFrame(kDatum);

RawFix at(double time, double x = 0.0) { return raw_fix(from_seconds(time), {x, 0.0}); }

TEST(FixQueue, FixesWaitForTheDatumAndKeepTheirOrder) {
  FixQueue queue({});
  for (const double time : {1.0, 2.0, 3.0}) EXPECT_FALSE(queue.add(at(time, 10.0 * time)));
  EXPECT_EQ(queue.next(), nullptr);
  EXPECT_FALSE(queue.last_stamp());
  EXPECT_TRUE(queue.validate(kFrame).empty());
  EXPECT_EQ(queue.last_stamp(), from_seconds(3.0));
  for (const double time : {1.0, 2.0, 3.0}) {
    ASSERT_NE(queue.next(), nullptr);
    EXPECT_EQ(queue.next()->fix.stamp, from_seconds(time));
    EXPECT_NEAR(queue.pop().fix.position.x(), 10.0 * time, 1e-6);
  }
  EXPECT_EQ(queue.next(), nullptr);
  EXPECT_EQ(queue.last_stamp(), from_seconds(3.0)) << "of those that have gone, too";
}

TEST(FixQueue, WhatNoDatumCanSaveIsRejectedAtOnce) {
  FixQueue queue({});
  RawFix without = at(2.0);
  without.has_fix = false;
  EXPECT_FALSE(queue.add(at(1.0)));
  const auto no_fix = queue.add(without);
  ASSERT_TRUE(no_fix);
  EXPECT_EQ(no_fix->decision, FixDecision::kRejectedStatus);
  EXPECT_EQ(no_fix->stamp, from_seconds(2.0));
  const auto came_twice = queue.add(at(1.0));
  ASSERT_TRUE(came_twice);
  EXPECT_EQ(came_twice->decision, FixDecision::kRejectedStale);
  EXPECT_TRUE(queue.validate(kFrame).empty());
  const auto after_validation = queue.add(at(0.5));
  ASSERT_TRUE(after_validation);
  EXPECT_EQ(after_validation->decision, FixDecision::kRejectedStale);
  queue.pop();
  EXPECT_EQ(queue.next(), nullptr);
}

TEST(FixQueue, RejectedFixesWaitNoLongerAndAreToldOnce) {
  FixQueue queue({});
  RawFix far = at(2.0);
  far.position.latitude_deg += 10.0;
  EXPECT_FALSE(queue.add(at(1.0)));
  EXPECT_FALSE(queue.add(far));
  const std::vector<FixOutcome> rejected = queue.validate(kFrame);
  ASSERT_EQ(rejected.size(), 1u);
  EXPECT_EQ(rejected[0].decision, FixDecision::kRejectedOutOfRange);
  EXPECT_EQ(rejected[0].stamp, from_seconds(2.0));
  EXPECT_TRUE(queue.validate(kFrame).empty());
  queue.pop();
  EXPECT_EQ(queue.next(), nullptr);
}

TEST(FixQueue, AStampThatIsNotSetIsNamed) {
  FixQueue queue({});
  EXPECT_FALSE(queue.add(at(0.0))) << "a simulation may begin at 0";
  const auto second = queue.add(at(0.0));
  ASSERT_TRUE(second);
  EXPECT_EQ(second->decision, FixDecision::kRejectedStale);
  EXPECT_NE(second->reason.find("header.stamp of gps/fix is 0"), std::string::npos) << second->reason;
}

TEST(FixQueue, AMistakeOfTheDriverIsSaidOnceAndItsCovarianceReplaced) {
  FixQueue queue({});
  std::vector<PipelineEvent> events;
  FixOutcome last;
  for (int k = 1; k <= 60; ++k) {
    if (k == 30) queue.reset();
    const double hdop = 0.8 + 0.1 * (k % 4);
    RawFix fix = at(k);
    fix.covariance = (hdop * hdop * Eigen::Vector3d(1.0, 1.0, 4.0)).asDiagonal();
    fix.covariance_type = CovarianceType::kApproximated;
    queue.add(fix);
    queue.validate(kFrame);
    for (PipelineEvent& event : queue.take_events()) events.push_back(std::move(event));
    const ValidatedFix validated = queue.pop();
    if (k > 10) {
      EXPECT_NEAR(validated.fix.covariance(0, 0), 16.0 * hdop * hdop, 1e-9);
    }
    last = validated.outcome;
  }
  ASSERT_EQ(events.size(), 1u) << "also across a reset";
  EXPECT_EQ(events.front().level, PipelineEvent::Level::kWarn);
  EXPECT_EQ(last.decision, FixDecision::kInflated);
  EXPECT_TRUE(last.covariance_clamped);
  EXPECT_EQ(last.reason, "declared covariance replaced: HDOP^2 as variance");
  EXPECT_EQ(queue.complaint(), "gps/fix has HDOP^2 as variance");
}

TEST(FixQueue, AFarFixIsExplainedOnceItIsNoAccident) {
  FixQueue queue({});
  std::vector<PipelineEvent> events;
  for (int k = 1; k <= 5; ++k) {
    RawFix south = at(k);
    south.position.latitude_deg *= -1.0;
    EXPECT_FALSE(queue.add(south));
    const std::vector<FixOutcome> rejected = queue.validate(kFrame);
    ASSERT_EQ(rejected.size(), 1u);
    EXPECT_NE(rejected[0].reason.find("the sign of the latitude"), std::string::npos) << rejected[0].reason;
    for (PipelineEvent& event : queue.take_events()) events.push_back(std::move(event));
  }
  ASSERT_EQ(events.size(), 1u);
  EXPECT_NE(events.front().text.find("the sign of the latitude"), std::string::npos);
}

TEST(FixQueue, ParametersAreThoseOfTheValidation) {
  FixValidationParameters parameters;
  parameters.fix_sigma_floor = 2.0;
  FixQueue queue(parameters);
  queue.add(at(1.0));
  queue.validate(kFrame);
  EXPECT_NEAR(queue.next()->fix.covariance(0, 0), 4.0, 1e-12);
  queue.reset();
  EXPECT_EQ(queue.next(), nullptr);
  EXPECT_FALSE(queue.last_stamp());
  queue.add(at(1.0));
  queue.validate(kFrame);
  EXPECT_NEAR(queue.next()->fix.covariance(0, 0), 4.0, 1e-12) << "kept by the reset";
}

TEST(FixQueue, AClampedCovarianceIsSaidOnceAMinute) {
  FixQueue queue({});
  std::vector<std::string> said;
  const auto add = [&](double time, double sigma) {
    queue.add(raw_fix(from_seconds(time), {0.0, 0.0}, sigma));
    queue.validate(kFrame);
    for (const PipelineEvent& event : queue.take_events()) {
      if (event.level == PipelineEvent::Level::kWarn) said.push_back(event.text);
    }
  };
  for (int k = 1; k <= 30; ++k) add(k, 1.0);
  EXPECT_TRUE(said.empty());
  for (int k = 31; k <= 131; ++k) add(k, 0.003);
  ASSERT_EQ(said.size(), 2u) << "at 31 s and at 91 s";
  EXPECT_NE(said[0].find("covariance of 1 fix was not used as declared: declared sigma 0.003 m raised"),
            std::string::npos)
      << said[0];
  EXPECT_NE(said[1].find("covariance of 60 fixes"), std::string::npos) << said[1];
}

TEST(FixQueue, OfTooManyTheOldestAreDropped) {
  for (const bool has_datum : {false, true}) {
    FixQueue queue({});
    for (int k = 1; k <= 1005; ++k) {
      queue.add(at(k));
      if (has_datum) queue.validate(kFrame);
    }
    queue.validate(kFrame);
    EXPECT_EQ(queue.next()->fix.stamp, from_seconds(6.0)) << has_datum;
  }
}

}  // namespace
}  // namespace urban_gnss
