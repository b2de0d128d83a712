#include "pipeline_rig.hpp"

namespace urban_gnss {
namespace {

/// A pipeline that has odometry and no datum, and what came of fixes.
struct Waiting : Rig {
  Waiting() : Rig("{}") { drive(0.0); }

  template <class Spoil>
  std::vector<FixOutcome> fixes(int count, const Spoil& spoil) {
    for (int k = 1; k <= count; ++k) {
      RawFix raw = raw_fix(at(k), truth(k).position());
      spoil(raw);
      pipeline.add_fix(raw);
      drive(k + 0.05);
    }
    return pipeline.take_outcomes();
  }
  bool says(const std::string& text) const { return pipeline.waiting_for().find(text) != std::string::npos; }
};

TEST(FixesBeforeTheDatum, EachHasItsDecisionAndTheReasonIsSaid) {
  Waiting rig;
  const std::vector<FixOutcome> outcomes = rig.fixes(8, [](RawFix& raw) { raw.has_fix = false; });
  ASSERT_EQ(outcomes.size(), 8u);
  for (const FixOutcome& outcome : outcomes) EXPECT_EQ(outcome.decision, FixDecision::kRejectedStatus);
  EXPECT_TRUE(rig.says("0 of 5 agreeing fixes; the last fix was rejected_status: the receiver has no fix"))
      << rig.pipeline.waiting_for();
  const LocalizationReport report = rig.pipeline.report();
  EXPECT_EQ(report.state, LocalizationState::kWaitingForDatum);
  EXPECT_EQ(report.fixes_rejected, 8u);
  EXPECT_EQ(report.last_fix.decision, FixDecision::kRejectedStatus);
  EXPECT_NE(report.reason.find("rejected_status"), std::string::npos) << report.reason;
}

TEST(FixesBeforeTheDatum, OtherReasonsToo) {
  Waiting scaled;
  scaled.fixes(6, [](RawFix& raw) {
    raw.position.latitude_deg *= 1e7;
    raw.position.longitude_deg *= 1e7;
  });
  EXPECT_TRUE(scaled.says("degrees times 1e7 of 33")) << scaled.pipeline.waiting_for();
  EXPECT_TRUE(has_event(scaled.pipeline, PipelineEvent::Level::kWarn, "degrees times 1e7"));
  Waiting swapped;
  swapped.fixes(6, [](RawFix& raw) { std::swap(raw.position.latitude_deg, raw.position.longitude_deg); });
  EXPECT_TRUE(swapped.says("swapped")) << swapped.pipeline.waiting_for();
  Waiting unset;
  unset.fixes(6, [](RawFix& raw) { raw.stamp = Stamp::zero(); });
  EXPECT_TRUE(unset.says("header.stamp of gps/fix is 0")) << unset.pipeline.waiting_for();
  Waiting at_sea;
  at_sea.fixes(6, [](RawFix& raw) { raw.position = {0.0, 0.0, 0.0}; });
  EXPECT_TRUE(at_sea.says("both 0")) << at_sea.pipeline.waiting_for();
}

TEST(FixesBeforeTheDatum, AStreamWhoseStampsAreNotSetIsNamedOnce) {
  Rig rig("{}");
  for (int k = 0; k < 5; ++k) {
    OdometrySample sample = Rig::odometry(0.1 * k);
    sample.stamp = Stamp::zero();
    rig.pipeline.add_odometry(sample);
  }
  const std::vector<PipelineEvent> events = rig.pipeline.take_events();
  ASSERT_EQ(events.size(), 1u);
  EXPECT_NE(events.front().text.find("header.stamp of odometry is 0"), std::string::npos) << events.front().text;
}

TEST(FixesBeforeTheDatum, AGoodOneWaitsForItAndIsDecidedOnce) {
  Waiting rig;
  EXPECT_TRUE(rig.fixes(4, [](RawFix&) {}).empty());
  EXPECT_EQ(rig.pipeline.report().last_fix.decision, FixDecision::kNotExamined);
  EXPECT_EQ(rig.pipeline.report().last_fix.reason, "waits for the datum");
  EXPECT_EQ(rig.pipeline.report().last_fix.stamp, Rig::at(4.0));
  EXPECT_EQ(rig.pipeline.waiting_for(), "the datum: 4 of 5 agreeing fixes");
  rig.fix(5.0);
  rig.drive(5.05);
  EXPECT_EQ(rig.pipeline.take_outcomes().size(), 5u);
}

TEST(FixesBeforeTheDatum, AStampThatIsNotSetResetsNothing) {
  Waiting rig;
  rig.fixes(8, [](RawFix&) {});
  rig.pipeline.take_events();
  RawFix unset = raw_fix(Stamp::zero(), Rig::truth(8.5).position());
  rig.pipeline.add_fix(unset);
  rig.drive(9.0);
  ASSERT_EQ(rig.pipeline.take_outcomes().back().decision, FixDecision::kRejectedStale);
  for (const PipelineEvent& event : rig.pipeline.take_events()) {
    EXPECT_EQ(event.text.find("reset"), std::string::npos) << event.text;
  }
  EXPECT_TRUE(rig.pipeline.frame());
}

}  // namespace
}  // namespace urban_gnss
