#include "pipeline_rig.hpp"
#include "urban_gnss_localization/pipeline/fix_queue.hpp"

namespace urban_gnss {
namespace {

const LocalFrame kFrame(kDatum);

RawFix at(double time, double x = 0.0) { return raw_fix(from_seconds(time), {x, 0.0}); }

TEST(FixQueue, FixesWaitForTheDatumAndKeepTheirOrder) {
  FixQueue queue({});
  for (const double time : {1.0, 2.0, 3.0}) queue.add(at(time, 10.0 * time));
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

TEST(FixQueue, RejectedFixesWaitNoLongerAndAreToldOnce) {
  FixQueue queue({});
  RawFix without = at(2.0);
  without.has_fix = false;
  queue.add(at(1.0));
  queue.add(without);
  queue.add(at(1.0));  // came twice
  const std::vector<FixOutcome> rejected = queue.validate(kFrame);
  ASSERT_EQ(rejected.size(), 2u);
  EXPECT_EQ(rejected[0].decision, FixDecision::kRejectedStatus);
  EXPECT_EQ(rejected[0].stamp, from_seconds(2.0));
  EXPECT_EQ(rejected[1].decision, FixDecision::kRejectedStale);
  EXPECT_TRUE(queue.validate(kFrame).empty());
  queue.pop();
  EXPECT_EQ(queue.next(), nullptr);
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
