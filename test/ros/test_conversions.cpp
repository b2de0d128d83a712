#include <gtest/gtest.h>

#include <initializer_list>
#include <limits>

#include "urban_gnss_localization/ros/conversions.hpp"
#include "urban_gnss_localization/ros/visibility_messages.hpp"

namespace urban_gnss {
namespace {

namespace msgs = urban_gnss_localization;

// RTK fixes jump beside houses, too (Sunray#145): a better status must not make a fix count for more.
TEST(Conversions, AFixOfABetterStatusIsNotTrustedMore) {
  sensor_msgs::NavSatFix message;
  message.latitude = 33.0;
  message.longitude = 130.0;
  message.position_covariance[0] = message.position_covariance[4] = message.position_covariance[8] = 9.0;
  message.position_covariance_type = sensor_msgs::NavSatFix::COVARIANCE_TYPE_KNOWN;
  const LocalFrame frame({33.0, 130.0, 0.0});
  const auto validated = [&](std::int8_t status) {
    message.status.status = status;
    return validate_fix(to_raw_fix(message), frame, std::nullopt, {});
  };
  const ValidatedFix plain = validated(sensor_msgs::NavSatStatus::STATUS_FIX);
  using Status = sensor_msgs::NavSatStatus;
  for (const int status : std::initializer_list<int>{Status::STATUS_SBAS_FIX, Status::STATUS_GBAS_FIX}) {
    const ValidatedFix better = validated(static_cast<std::int8_t>(status));
    EXPECT_EQ(better.fix.covariance, plain.fix.covariance) << status;
    EXPECT_EQ(better.outcome.decision, plain.outcome.decision) << status;
  }
  EXPECT_TRUE(is_rejected(validated(sensor_msgs::NavSatStatus::STATUS_NO_FIX).outcome.decision));
}

// Drivers fill in `used` from other epochs, or not at all (gps_umd#100).
TEST(Conversions, WhatADriverSaysOfUsedSatellitesIsNotReliedOn) {
  msgs::SatelliteArray message;
  using Satellite = msgs::Satellite;
  for (const int used : std::initializer_list<int>{Satellite::USED, Satellite::NOT_USED, Satellite::USE_UNKNOWN}) {
    Satellite satellite;
    satellite.svid = 7;
    satellite.azimuth = 1.0F;
    satellite.elevation = 0.5F;
    satellite.cn0 = 45.0F;
    satellite.tracked = 1;
    satellite.used = static_cast<std::int8_t>(used);
    message.satellites.push_back(satellite);
  }
  const std::vector<SatelliteObservation> all = to_observations(message);
  ASSERT_EQ(all.size(), 3u);
  for (const SatelliteObservation& each : all) {
    EXPECT_TRUE(each.tracked);
    EXPECT_EQ(each.cn0_dbhz, 45.0);
  }
}

// rostopic echo shows numbers only; who reads them should not need the definition beside them.
TEST(Conversions, EnumerationsAreSaidInWords) {
  FixOutcome outcome;
  outcome.decision = FixDecision::kRejectedGate;
  EXPECT_EQ(to_message(outcome).decision_name, "rejected_gate");
  FixAssessment assessment;
  assessment.covariance.source = VisibilitySource::kLidarAndSatellites;
  EXPECT_EQ(to_message(assessment, std::nullopt, {}, ros::Time(1.0), "map").source_name, "lidar_and_satellites");
}

TEST(Conversions, WhatAPlanarFilterDoesNotEstimateHasALargeVariance) {
  LocalizationOutput output;
  output.estimate.covariance << 4.0, 1.0, 0.1, 1.0, 9.0, 0.2, 0.1, 0.2, 0.01;
  const nav_msgs::Odometry message = to_message(output, Frames{});
  for (const std::size_t axis : {2u, 3u, 4u}) EXPECT_GE(message.pose.covariance[7 * axis], 1e6) << axis;
  EXPECT_EQ(message.pose.covariance[0], 4.0);
  EXPECT_EQ(message.pose.covariance[1], 1.0);
  EXPECT_EQ(message.pose.covariance[7], 9.0);
  EXPECT_EQ(message.pose.covariance[35], 0.01);
  EXPECT_EQ(message.pose.covariance[5], 0.1);
}

TEST(Conversions, TfIsFromMapToOdomAlone) {
  const Pose2 map_to_odometry{1.0, 2.0, 0.5};
  const auto transform = to_map_to_odom(map_to_odometry, from_seconds(3.0), Frames{}, 0.25);
  EXPECT_EQ(transform.header.frame_id, "map");
  EXPECT_EQ(transform.child_frame_id, "odom");
  EXPECT_EQ(transform.header.stamp, ros::Time(3.25));
  EXPECT_EQ(transform.transform.translation.x, 1.0);
  EXPECT_EQ(transform.transform.translation.y, 2.0);
}

TEST(Conversions, ADecisionIsPublishedWithItsEvidence) {
  FixOutcome outcome;
  outcome.stamp = from_seconds(12.5);
  outcome.decision = FixDecision::kRejectedGate;
  outcome.nis = 14.0;
  outcome.nis_threshold = 9.21;
  outcome.nis_dof = 2;
  outcome.covariance_clamped = true;
  outcome.reason = "far away";
  const msgs::FixDecision message = to_message(outcome);
  EXPECT_EQ(message.stamp, ros::Time(12.5));
  EXPECT_EQ(message.decision, int(msgs::FixDecision::REJECTED_GATE));
  EXPECT_EQ(message.nis, 14.0);
  EXPECT_EQ(message.nis_threshold, 9.21);
  EXPECT_EQ(message.nis_dof, 2);
  EXPECT_TRUE(message.covariance_clamped);
  EXPECT_EQ(message.reason, "far away");
  EXPECT_FALSE(is_rejected(FixDecision::kNotExamined)) << "not examined is not failed";
}

TEST(VisibilityMarkers, ShowRaysInTheirColoursAndTheNumberOfSatellites) {
  FixAssessment assessment;
  assessment.has_map = true;
  msgs::Visibility visibility;
  visibility.satellites_used = 2;
  visibility.satellites_visible = 1;
  using Satellite = msgs::SatelliteVisibility;
  for (const int each : std::initializer_list<int>{Satellite::FREE, Satellite::BLOCKED}) {
    Satellite satellite;
    satellite.visibility = static_cast<std::uint8_t>(each);
    satellite.elevation = 0.5F;
    satellite.range = std::numeric_limits<float>::infinity();
    visibility.satellites.push_back(satellite);
  }
  const auto of = [&](const std::string& ns) {
    std::vector<visualization_msgs::Marker> found;
    for (const auto& each : ray_markers(assessment, visibility, ros::Time(1.0), "odom").markers) {
      if (each.ns == ns) found.push_back(each);
    }
    return found;
  };
  const auto rays = of("rays");
  ASSERT_EQ(rays.size(), 2u);
  EXPECT_GT(rays[0].color.g, rays[0].color.r) << "free is green";
  EXPECT_GT(rays[1].color.r, rays[1].color.g) << "blocked is orange";
  ASSERT_EQ(of("satellite_count").size(), 1u);
  EXPECT_EQ(of("satellite_count")[0].text, "1 of 2 satellites");
  assessment.has_map = false;
  EXPECT_EQ(of("satellite_count").size(), 1u) << "without a map, too";
}

}  // namespace
}  // namespace urban_gnss
