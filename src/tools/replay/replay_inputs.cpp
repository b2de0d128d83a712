#include "replay_inputs.hpp"

#include <algorithm>
#include <filesystem>
#include <stdexcept>
#include <string>

#include "bag_messages.hpp"
#include "urban_gnss_localization/ros/conversions.hpp"
#include "urban_gnss_localization/ros/receiver_messages.hpp"
#include "urban_gnss_localization/ros/topics.hpp"

namespace urban_gnss {
namespace {

using Messages = std::vector<rosbag::MessageInstance>;
using urban_gnss_localization::SatelliteArray;

/// The topics that are read, without their leading slashes.
struct Topics {
  explicit Topics(const ReplayOptions& options)
      : fix(without_leading_slash(options.fix_topic)),
        odom(without_leading_slash(options.odom_topic)),
        imu(without_leading_slash(options.imu_topic)),
        velocity(without_leading_slash(options.velocity_topic)),
        satellites(without_leading_slash(options.satellites_topic)),
        truth(without_leading_slash(options.truth_topic)) {}

  /// In the order in which messages of one time are read.
  std::vector<std::string> ordered() const { return {topics::kDatum, imu, odom, fix, velocity, satellites, truth}; }

  std::string fix, odom, imu, velocity, satellites, truth;
};

/// Throws std::runtime_error, which lists what the bag has, where a topic that is needed has no message.
void require_topics(const rosbag::Bag& bag, const Messages& messages, const ReplayOptions& options,
                    const Topics& names) {
  const auto require = [&](bool is_needed, const std::string& option, const std::string& name) {
    const auto is_of_it = [&](const auto& message) { return without_leading_slash(message.getTopic()) == name; };
    if (!is_needed || std::any_of(messages.begin(), messages.end(), is_of_it)) return;
    throw std::runtime_error(options.input + " has no message on " + name + " (" + option + "); it has" +
                             topics_of(bag));
  };
  require(true, "--fix-topic", names.fix);
  require(true, "--odom-topic", names.odom);
  require(options.wants_imu, "--imu-topic", names.imu);
  require(options.wants_velocity, "--velocity-topic", names.velocity);
  require(options.wants_satellites, "--satellites-topic", names.satellites);
}

void give(const rosbag::MessageInstance& message, const Topics& names, ReplayRun& run) {
  const std::string name = without_leading_slash(message.getTopic());
  if (name == names.odom) {
    run.add_odometry(to_odometry_sample(*expect<nav_msgs::Odometry>(message)));
  } else if (name == names.fix) {
    run.add_fix(to_raw_fix(*expect<sensor_msgs::NavSatFix>(message)));
  } else if (name == names.velocity) {
    const auto measured = to_raw_velocity_of(message);
    if (!measured) throw wrong_type(message, kVelocityTypes);
    run.add_velocity(*measured);
  } else if (name == names.satellites) {
    run.add_satellites(to_satellite_epoch(*expect<SatelliteArray>(message)));
  } else if (name == names.imu) {
    run.add_imu(*expect<sensor_msgs::Imu>(message));
  } else if (name == names.truth) {
    run.add_truth(*expect<nav_msgs::Odometry>(message));
  } else {
    run.set_datum(*expect<sensor_msgs::NavSatFix>(message));
  }
}

}  // namespace

ReplayInputs::ReplayInputs(const ReplayOptions& options) { read_bag(options); }

void ReplayInputs::read_bag(const ReplayOptions& options) {
  if (!std::filesystem::exists(options.input)) throw std::runtime_error(options.input + ": no such bag");
  bag_.open(options.input, rosbag::bagmode::Read);
  const Topics names(options);
  const Messages messages = ordered_messages(bag_, names.ordered());
  require_topics(bag_, messages, options, names);
  for (const rosbag::MessageInstance& message : messages) {
    inputs_.push_back({to_stamp(message.getTime()), [message, names](ReplayRun& run) { give(message, names, run); }});
  }
}

double ReplayInputs::duration_s() const {
  return inputs_.empty() ? 0.0 : to_seconds(inputs_.back().time - inputs_.front().time);
}

}  // namespace urban_gnss
