#pragma once

#include <nav_msgs/Odometry.h>
#include <sensor_msgs/NavSatFix.h>
#include <urban_gnss_localization/LocalizationStatus.h>

#include <Eigen/Core>
#include <cmath>
#include <cstddef>
#include <iostream>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "files/bag_reader.hpp"
#include "replay/text_counts.hpp"
#include "urban_gnss_localization/evaluation/track_report.hpp"
#include "urban_gnss_localization/pipeline/status_reporter.hpp"
#include "urban_gnss_localization/ros/conversions.hpp"
#include "urban_gnss_localization/ros/topics.hpp"

/// What a bag has of tracks: estimates, truth, fixes, and what localizers said.
namespace urban_gnss {

/// Calls `use` with every message of the topic, written with or without a leading slash. False where there is none.
template <class Message, class Use>
bool for_each_message(const BagReader& bag, const std::string& topic, Use use) {
  BagMessages messages(bag, {without_leading_slash(topic)});
  while (const auto message = messages.next()) use(*expect<Message>(*message));
  return messages.size() > 0;
}

struct OdometryTrack {
  Trajectory trajectory;
  std::vector<double> speeds_mps;  ///< of its poses; NaN where the message has no twist
  std::string frame;
};

/// Empty where the bag has no such topic.
inline std::optional<OdometryTrack> read_odometry(const BagReader& bag, const std::string& topic) {
  OdometryTrack track;
  std::size_t not_finite = 0;
  std::map<Stamp, double> speeds;
  const bool found = for_each_message<nav_msgs::Odometry>(bag, topic, [&](const nav_msgs::Odometry& odometry) {
    track.frame = without_leading_slash(odometry.header.frame_id);
    track.trajectory.push_back(to_timed_pose(odometry));
    const auto& velocity = odometry.twist.twist.linear;
    speeds[track.trajectory.back().stamp] = std::hypot(velocity.x, velocity.y);
    if (!is_finite(track.trajectory.back().pose)) ++not_finite;
  });
  if (!found) return std::nullopt;
  if (not_finite > 0) {
    std::cerr << bag.name() << ": topic " << topic << ": " << not_finite << " poses are not finite\n";
  }
  sort_by_stamp(track.trajectory);
  for (const TimedPose& pose : track.trajectory) track.speeds_mps.push_back(speeds[pose.stamp]);
  return track;
}

inline std::optional<LocalFrame> read_datum(const BagReader& bag) {
  std::optional<LocalFrame> frame;
  for_each_message<sensor_msgs::NavSatFix>(bag, topics::kDatum, [&](const sensor_msgs::NavSatFix& datum) {
    frame.emplace(GeodeticPosition{datum.latitude, datum.longitude, datum.altitude});
  });
  return frame;
}

struct FixTrack {
  Trajectory fixes;  ///< as poses without a yaw
  std::size_t without_position{0};
};

inline FixTrack read_fixes(const BagReader& bag, const std::string& topic, const LocalFrame& frame) {
  FixTrack track;
  for_each_message<sensor_msgs::NavSatFix>(bag, topic, [&](const sensor_msgs::NavSatFix& fix) {
    ++track.without_position;
    if (fix.status.status < sensor_msgs::NavSatStatus::STATUS_FIX) return;
    // A fix without a height is still a horizontal fix.
    const double altitude = std::isfinite(fix.altitude) ? fix.altitude : frame.datum().altitude_m;
    const Eigen::Vector3d local = frame.to_local({fix.latitude, fix.longitude, altitude});
    if (!local.allFinite()) return;
    --track.without_position;
    TimedPose pose;
    pose.stamp = to_stamp(fix.header.stamp);
    pose.pose = {local.x(), local.y(), std::numeric_limits<double>::quiet_NaN()};
    if (fix.position_covariance_type != sensor_msgs::NavSatFix::COVARIANCE_TYPE_UNKNOWN) {
      pose.covariance.topLeftCorner<2, 2>() << fix.position_covariance[0], fix.position_covariance[1],
          fix.position_covariance[3], fix.position_covariance[4];
    }
    track.fixes.push_back(pose);
  });
  sort_by_stamp(track.fixes);
  return track;
}

/// The namespace `levels` above a topic, with its slash at the end: "a/b/c" has "a/b/", "a/" and "" above it.
inline std::string namespace_above(std::string topic, int levels) {
  for (; levels > 0 && !topic.empty(); --levels) {
    const std::size_t slash = topic.rfind('/', topic.size() - 2);
    topic = slash == std::string::npos || topic.size() < 2 ? "" : topic.substr(0, slash + 1);
  }
  return topic;
}

/// What a localizer said: its states where they change, and why it is not healthy, and its decisions by the fixes'
/// stamps.
struct StatusTrack {
  std::string localizer;
  std::vector<StatedState> states;
  std::map<Stamp, FixOutcome> outcomes;
};

/// Of the localizer that published the estimate: its ~status is `NODE/status` beside `odometry/filtered`, in a bag of
/// replay `status`. Empty where the bag has none.
inline StatusTrack read_status(const BagReader& bag, const std::string& estimate_topic) {
  StatusTrack track;
  const std::string home = namespace_above(without_leading_slash(estimate_topic), 2);
  for (const BagConnection& connection : bag.connections()) {
    if (connection.type != "urban_gnss_localization/LocalizationStatus") continue;
    if (namespace_above(without_leading_slash(connection.topic), 2) != home) continue;
    for_each_message<urban_gnss_localization::LocalizationStatus>(
        bag, connection.topic, [&](const urban_gnss_localization::LocalizationStatus& status) {
          track.localizer = status.localizer;
          if (!status.last_fix.stamp.isZero())
            track.outcomes[to_stamp(status.last_fix.stamp)] = to_outcome(status.last_fix);
          StatedState state{to_stamp(status.header.stamp), to_string(static_cast<LocalizationState>(status.state)),
                            status.healthy != 0, status.reason};
          const StatedState* last = track.states.empty() ? nullptr : &track.states.back();
          const bool is_same = last && last->state == state.state && last->healthy == state.healthy;
          if (is_same && (state.healthy || TextCounts::kind_of(last->reason) == TextCounts::kind_of(state.reason))) {
            return;
          }
          if (last && state.stamp < last->stamp) state.stamp = last->stamp;
          track.states.push_back(state);
        });
    break;
  }
  return track;
}

}  // namespace urban_gnss
