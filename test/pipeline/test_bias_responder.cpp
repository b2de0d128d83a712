#include "pipeline_rig.hpp"
#include "urban_gnss_localization/pipeline/bias_pipeline.hpp"
#include "urban_gnss_localization/pipeline/bias_responder.hpp"

namespace urban_gnss {
namespace {

/// m, of the fix at `time`.
Eigen::Vector2d bias_at(double time) { return {0.4 * time, time > 20.0 ? 6.0 : 0.0}; }

/// One in the localizer's process and one as a node of its own, beside the same localizer.
struct BothFilters {
  Rig rig{kGiven, true};
  BiasPipeline node{BiasPipelineParameters{}};
  BiasResponder responder{GpsBiasParameters{}};
  std::vector<BiasEstimate> by_responder;
  std::vector<BiasEstimate> by_node;

  BothFilters() {
    rig.pipeline.set_antenna_offset({0.4, -0.3});
    node.set_antenna_offset({0.4, -0.3});
    node.set_datum(kDatum);
  }
  void run(double from, double to) {
    for (long k = std::lround(10.0 * from); k <= std::lround(10.0 * to); ++k) step(0.1 * k, k % 10 == 0);
  }
  void step(double time, bool has_fix) {
    rig.drive(time);
    node.add_odometry(Rig::odometry(time));
    for (const LocalizationOutput& output : rig.pipeline.take_outputs()) {
      node.add_estimate(output.stamp, output.estimate.pose);
    }
    if (has_fix) {
      const Eigen::Vector2d place = transform_point(Rig::truth(time), {0.4, -0.3}) + bias_at(time);
      rig.pipeline.add_fix(raw_fix(Rig::at(time), place));
      node.add_fix(raw_fix(Rig::at(time), place));
    }
    for (const BiasEstimate& bias : responder.answer(rig.pipeline)) by_responder.push_back(bias);
    for (const BiasEstimate& bias : node.take_estimates()) by_node.push_back(bias);
  }
};

TEST(BiasResponder, AnswersAsTheNodeDoes) {
  BothFilters both;
  both.run(0.0, 40.0);
  ASSERT_EQ(both.by_responder.size(), 41u);
  ASSERT_EQ(both.by_node.size(), 41u);
  for (std::size_t i = 0; i < 41; ++i) {
    const BiasEstimate& a = both.by_responder[i];
    const BiasEstimate& b = both.by_node[i];
    EXPECT_EQ(a.stamp, b.stamp);
    EXPECT_LT((a.predicted_antenna_position - b.predicted_antenna_position).norm(), 1e-9) << i;
    EXPECT_LT((a.bias - b.bias).norm(), 1e-9) << i;
    EXPECT_LT((a.covariance - b.covariance).norm(), 1e-9) << i;
    EXPECT_EQ(a.in_shadow, b.in_shadow) << i;
    EXPECT_EQ(a.outcome.decision, b.outcome.decision) << i;
  }
  EXPECT_GT(both.by_node.back().radius_m, 10.0);
  EXPECT_EQ(both.rig.fake->fixes.back().bias_radius_m, both.by_responder.back().radius_m);
}

TEST(BiasResponder, AnotherEpochOfThePipelineStartsTheFilterAnew) {
  BothFilters both;
  both.run(0.0, 10.0);
  const Eigen::Matrix2d at_start = both.by_responder.front().covariance;
  EXPECT_LT(both.by_responder.back().covariance(0, 0), 0.9 * at_start(0, 0));
  both.rig.pipeline.reset("a test");
  both.rig.pipeline.set_pose(pose_with_sigma(Rig::truth(11.0), 1.0, 0.1));
  both.run(11.0, 11.0);
  EXPECT_LT((both.by_responder.back().covariance - at_start).norm(), 1e-9);
  EXPECT_EQ(both.by_responder.back().stamp, Rig::at(11.0));
}

}  // namespace
}  // namespace urban_gnss
