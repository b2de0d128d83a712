#include <gmock/gmock.h>

#include "pipeline_rig.hpp"
#include "urban_gnss_localization/pipeline/rate_monitor.hpp"

namespace urban_gnss {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;

/// What is said of a stream of `count` messages.
std::vector<std::string> said(RateMonitor& monitor, double& time, double interval, int count) {
  std::vector<std::string> all;
  for (int k = 0; k < count; ++k) {
    time += interval;
    const std::string news = monitor.add(from_seconds(time));
    if (!news.empty()) all.push_back(news);
  }
  return all;
}

TEST(RateMonitor, SaysOnceThatAStreamComesAtAnotherRate) {
  RateMonitor monitor;
  double time = 0.0;
  EXPECT_THAT(said(monitor, time, 1.0, 100), IsEmpty());
  EXPECT_THAT(said(monitor, time, 0.2, 100), testing::ElementsAre("5 Hz, 1 Hz before"));
  EXPECT_THAT(said(monitor, time, 1.0, 100), testing::ElementsAre("1 Hz, 5 Hz before"));
  monitor.reset();
  EXPECT_THAT(said(monitor, time, 0.2, 100), IsEmpty());
}

TEST(RateMonitor, ASecondSourceAddsItsRate) {
  RateMonitor monitor;
  double time = 0.0;
  said(monitor, time, 1.0, 50);
  std::vector<std::string> news;
  for (int k = 0; k < 20; ++k) {
    for (const double interval : {0.1, 0.9}) {
      for (const std::string& each : said(monitor, time, interval, 1)) news.push_back(each);
    }
  }
  EXPECT_THAT(news, testing::ElementsAre("2 Hz, 1 Hz before"));
}

TEST(RateMonitor, GapsAndJitterAreNoOtherRate) {
  RateMonitor monitor;
  RandomEngine engine = make_engine(1);
  double time = 0.0;
  for (int k = 0; k < 1000; ++k) {
    const double interval = (k % 6 == 0 ? 3.0 : 1.0) + 0.1 * (draw_uniform(engine) - 0.5);
    EXPECT_THAT(said(monitor, time, interval, 1), IsEmpty()) << k;
  }
}

TEST(RateMonitor, ThePipelineWarnsOfFixes) {
  Rig rig(kGiven);
  rig.run(0.0, 40.0);
  EXPECT_FALSE(has_event(rig.pipeline, PipelineEvent::Level::kWarn, "another rate"));
  for (int k = 401; k <= 500; ++k) {
    if (k % 2 == 0) rig.fix(0.1 * k);
    rig.drive(0.1 * k);
  }
  EXPECT_TRUE(has_event(rig.pipeline, PipelineEvent::Level::kWarn, "another rate, 5 Hz, 1 Hz before"));
}

}  // namespace
}  // namespace urban_gnss
