#include "urban_gnss_localization/ros/receiver_publishers.hpp"

#include "urban_gnss_localization/ros/event_log.hpp"
#include "urban_gnss_localization/ros/receiver_messages.hpp"
#include "urban_gnss_localization/ros/topics.hpp"

namespace urban_gnss {

ReceiverPublishers::ReceiverPublishers(ros::NodeHandle& node)
    : fix_(node.advertise<sensor_msgs::NavSatFix>(topics::kFix, 100)),
      velocity_(node.advertise<geometry_msgs::TwistWithCovarianceStamped>(topics::kVelocity, 100)),
      satellites_(node.advertise<urban_gnss_localization::SatelliteArray>(topics::kSatellites, 100)) {}

void ReceiverPublishers::publish(const ReceiverOutput& output, const std::string& frame) const {
  for (const std::string& warning : output.warnings) ROS_WARN_STREAM(log_line(warning));
  for (const RawFix& fix : output.fixes) fix_.publish(to_message(fix, frame));
  for (const RawVelocity& velocity : output.velocities) velocity_.publish(to_message(velocity, frame));
  for (const SatelliteEpoch& epoch : output.satellites) satellites_.publish(to_message(epoch, frame));
}

void add_counts(const ReceiverCounts& counts, diagnostic_updater::DiagnosticStatusWrapper& status) {
  status.add("fixes", counts.fixes);
  status.add("solutions without a fix", counts.no_fixes);
  status.add("velocities", counts.velocities);
  status.add("lists of satellites", counts.epochs);
  status.add("fixes with satellites", counts.fixes_with_satellites);
  status.add("fixes with residuals", counts.fixes_with_residuals);
}

}  // namespace urban_gnss
