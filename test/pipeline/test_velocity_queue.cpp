#include "pipeline_rig.hpp"
#include "urban_gnss_localization/pipeline/velocity_queue.hpp"

namespace urban_gnss {
namespace {

TEST(VelocityQueue, VelocityThatNoRobotHasIsAFault) {
  RawVelocity velocity;
  velocity.velocity = {149.0, 0.0};
  EXPECT_EQ(velocity_fault(velocity), "");
  velocity.velocity = {149.0, 20.0};
  EXPECT_EQ(velocity_fault(velocity), "beyond 150 m/s");
  velocity.velocity = {0.0, kNaN};
  EXPECT_EQ(velocity_fault(velocity), "not finite");
}

TEST(VelocityQueue, WaitsForTheOdometryInItsOrder) {
  VelocityQueue queue({});
  queue.add(Rig::velocity(1.0));
  queue.add(Rig::velocity(2.0));
  EXPECT_FALSE(queue.take(Rig::at(0.99)));
  EXPECT_EQ(queue.take(Rig::at(1.0)).value().stamp, Rig::at(1.0));
  EXPECT_FALSE(queue.take(Rig::at(1.99)));
  EXPECT_EQ(queue.take(Rig::at(5.0)).value().stamp, Rig::at(2.0));
  EXPECT_FALSE(queue.take(Rig::at(5.0)));
  queue.add(Rig::velocity(3.0));
  queue.reset();
  EXPECT_FALSE(queue.take(Rig::at(5.0)));
}

TEST(VelocityQueue, GivesACovarianceThatCanBeWorkedWith) {
  VelocityQueue queue({});
  RawVelocity none = Rig::velocity(1.0);
  none.covariance.setZero();
  queue.add(none);
  const Eigen::Matrix2d standard = queue.take(Rig::at(1.0)).value().covariance;
  for (const double covariance : {-1.0, 0.005, 1e300}) {
    RawVelocity skew = Rig::velocity(1.0);
    skew.covariance << 0.01, covariance, 0.0, 0.01;
    queue.add(skew);
    EXPECT_EQ(queue.take(Rig::at(1.0)).value().covariance, standard) << covariance;
  }
  for (const double variance : {1e5, 1e300, std::numeric_limits<double>::max()}) {
    RawVelocity huge = Rig::velocity(1.0);
    huge.covariance << variance, 0.0, 0.0, 0.01;
    queue.add(huge);
    EXPECT_EQ(queue.take(Rig::at(1.0)).value().covariance, Eigen::Matrix2d(150.0 * 150.0 * Eigen::Matrix2d::Identity()))
        << variance;
  }
}

TEST(VelocityQueue, MatchedVelocitiesDifferByTheHeadingAlone) {
  const Eigen::Vector2d antenna(0.7, -0.4);
  OdometryHistory history;
  for (int k = 0; k <= 40; ++k) history.add(Rig::at(0.1 * k), Rig::kTwist);
  for (const double time : {0.0, 1.23, 4.0}) {
    const auto matched = match_velocity(Rig::velocity(time, antenna), history, antenna);
    ASSERT_TRUE(matched) << time;
    // The odometry's frame is the map frame here, as the history starts with the truth.
    EXPECT_LT((matched->pair.odometry - matched->pair.measured).norm(), 1e-9) << time;
    const Pose2 heading_now{0.0, 0.0, Rig::truth(4.0).yaw};
    const Eigen::Vector2d in_map = transform_point(heading_now, matched->measurement.antenna_velocity_in_body);
    EXPECT_LT((in_map - matched->measurement.velocity).norm(), 1e-9) << time;
  }
  EXPECT_FALSE(match_velocity(Rig::velocity(4.1), history, antenna));
  EXPECT_FALSE(match_velocity(Rig::velocity(-0.1), history, antenna));
}

}  // namespace
}  // namespace urban_gnss
