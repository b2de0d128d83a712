#include "replay_inputs.hpp"

#include <sensor_msgs/PointCloud2.h>

#include <algorithm>
#include <iomanip>
#include <iostream>
#include <map>
#include <optional>
#include <stdexcept>
#include <utility>
#include <vector>

#include "nmea_log.hpp"
#include "urban_gnss_localization/evaluation/stamp_text.hpp"
#include "urban_gnss_localization/ros/conversions.hpp"
#include "urban_gnss_localization/ros/receiver_messages.hpp"
#include "urban_gnss_localization/ros/topics.hpp"

namespace urban_gnss {
namespace {

using ros::message_traits::DataType;
using urban_gnss_localization::SatelliteArray;

constexpr auto is_earlier = [](const auto& a, const auto& b) { return a.time < b.time; };

ReceiverRecording read_nmea_recording(const ReplayOptions& options) {
  if (options.receiver != "navsatfix") throw std::runtime_error("--nmea and --receiver: give one of them");
  const auto day = options.nmea_date.empty() ? std::nullopt : std::optional<Day>(parse_date(options.nmea_date));
  const NmeaLog log = read_nmea_log(options.nmea, day);
  for (const std::string& warning : log.output.warnings) std::cerr << options.nmea << ": " << warning << '\n';
  std::cerr << options.nmea << ": " << summary_of(log) << '\n';
  ReceiverRecording recording = to_recording(log, options.nmea);
  if (recording.outputs.empty()) throw std::runtime_error(options.nmea + ": no solution in it can be used");
  return recording;
}

/// From when to when a bag was recorded; nothing where it is empty.
std::optional<std::pair<Stamp, Stamp>> span_of(const BagFile& file) {
  std::optional<std::pair<Stamp, Stamp>> span;
  for (const BagFile::Chunk& chunk : file.chunks()) {
    if (!span) span.emplace(chunk.first, chunk.last);
    span->first = std::min(span->first, chunk.first);
    span->second = std::max(span->second, chunk.last);
  }
  return span;
}

/// Parts of one recording follow each other within moments.
void warn_of_far_parts(const BagReader& bag) {
  constexpr double kFar_h = 1.0;
  std::vector<std::pair<std::pair<Stamp, Stamp>, std::string>> parts;
  for (const auto& file : bag.files()) {
    if (const auto span = span_of(*file)) parts.emplace_back(*span, file->path());
  }
  std::sort(parts.begin(), parts.end());
  for (std::size_t i = 1; i < parts.size(); ++i) {
    const double hours = to_seconds(parts[i].first.first - parts[i - 1].first.second) / 3600.0;
    if (hours < kFar_h) continue;
    std::cerr << "replay: " << parts[i].second << " begins " << std::fixed << std::setprecision(1) << hours
              << " h after " << parts[i - 1].second
              << " ends: are they one recording? Recordings each for itself: --jobs\n";
  }
}

/// The topics of a bag that could be what was asked for: of a type in `types` ("a or b"), and no output of a localizer
/// or simulator.
std::string candidates(const BagReader& bag, const std::string& types) {
  std::string found;
  for (const BagConnection& each : bag.connections()) {
    const std::string name = without_leading_slash(each.topic);
    const bool is_output = name == topics::kDatum || name == topics::kFilteredFix || name == topics::kEstimate ||
                           name == topics::kTruth || !why_not_a_receiver(each.topic).empty();
    const bool is_of_type = (" " + types + " ").find(" " + each.type + " ") != std::string::npos;
    if (is_of_type && !is_output && bag.count(name) > 0) found += " " + each.topic;
  }
  return found;
}

bool is_latched(const std::string& name) { return name == topics::kDatum || name == topics::kStaticTf; }

}  // namespace

ReplayTopics::ReplayTopics(const ReplayOptions& options)
    : fix(without_leading_slash(options.fix_topic)),
      odom(without_leading_slash(options.odom_topic)),
      imu(without_leading_slash(options.imu_topic)),
      velocity(without_leading_slash(options.velocity_topic)),
      satellites(without_leading_slash(options.satellites_topic)),
      points(without_leading_slash(options.points_topic)),
      truth(without_leading_slash(options.truth_topic)) {}

ReplayInputs::ReplayInputs(const ReplayOptions& options) : options_(options), topics_(options) {
  if (!options.bags.empty()) bag_.emplace(options.bags);
  if (bag_) warn_of_far_parts(*bag_);
  read_receiver();
  if (bag_) read_topics();
  if (options.without_odometry) {
    for (const TimedOdometry& each : odometry_of(*recording_)) {
      others_.push_back({each.time, [sample = each.sample](ReplayRun& run) { run.add_odometry(sample); }});
    }
  }
  if (!recording_) return;
  require_overlap();
  for (const TimedOutput& each : recording_->outputs) {
    others_.push_back({each.time, [this, &output = each.output](ReplayRun& run) {
                         run.add_receiver(output, recording_->antenna_frame);
                       }});
  }
  std::stable_sort(others_.begin(), others_.end(), is_earlier);
}

void ReplayInputs::read_receiver() {
  const bool has_driver = find_receiver_preset(options_.receiver).make != nullptr;
  if (!options_.nmea.empty()) {
    recording_ = read_nmea_recording(options_);
  } else if (has_driver && options_.without_odometry) {
    recording_ = decode_receiver(*bag_, options_);  // the odometry is made of what it says later
  } else if (has_driver) {
    driver_.emplace(*bag_, options_);
  } else if (options_.without_odometry) {
    recording_ = read_receiver_topics(*bag_, options_);
  }
  if (has_driver) say_what_is_left_out();
}

/// Says on standard error which of the usual topics are not read beside a driver's.
void ReplayInputs::say_what_is_left_out() const {
  const std::string source = driver_ ? driver_->source() : recording_->source;
  std::string names;
  for (const std::string& name : {topics_.velocity, topics_.satellites}) {
    if (bag_->count(name) > 0 && (source + " ").find(" " + name + " ") == std::string::npos) names += " " + name;
  }
  if (!names.empty()) std::cerr << "replay: taken from receiver " << source << "; left out:" << names << '\n';
}

void ReplayInputs::read_topics() {
  // In the order in which messages of one time are read.
  std::vector<std::string> wanted{topics::kDatum, topics::kStaticTf};
  if (options_.occlusion) wanted.push_back(kTf);
  if (!options_.without_odometry) wanted.insert(wanted.end(), {topics_.imu, topics_.odom});
  if (options_.occlusion) wanted.push_back(topics_.points);
  if (driver_ || recording_) {
    wanted.push_back(topics_.truth);
  } else {
    wanted.insert(wanted.end(), {topics_.fix, topics_.velocity, topics_.satellites, topics_.truth});
    const std::string fused = why_not_a_receiver(topics_.fix);
    if (!fused.empty()) throw std::runtime_error("--fix-topic: " + fused);
  }
  if (driver_) wanted.insert(wanted.end(), driver_->names().begin(), driver_->names().end());
  require_topics();
  if (options_.occlusion) require_clouds();
  messages_.emplace(*bag_, wanted);
}

/// Throws std::runtime_error, which lists what the bag has, where a topic that is needed has no message.
void ReplayInputs::require_topics() const {
  const bool has_receiver = driver_ || recording_;
  std::map<std::string, std::string> option_of;
  const auto require = [&](bool is_needed, const std::string& option, const std::string& name, const std::string& types,
                           const std::string& else_what = "") {
    const auto [other, is_first] = option_of.emplace(name, option);
    if (!is_first && !name.empty()) {
      throw std::runtime_error(other->second + " and " + option + " are the same topic, " + name);
    }
    if (!is_needed || bag_->count(name) > 0) return;
    const std::string meant = candidates(*bag_, types);
    throw std::runtime_error(bag_->name() + " has no message on " + name + " (" + option + "); " +
                             (meant.empty() ? "it has no " + types + else_what : "did you mean" + meant + "?") +
                             "\nAll that it has:" + bag_->topics());
  };
  require(!has_receiver, "--fix-topic", topics_.fix, DataType<sensor_msgs::NavSatFix>::value());
  require(!options_.without_odometry, "--odom-topic", topics_.odom, DataType<nav_msgs::Odometry>::value(),
          ": --odom none makes the motion of what the receiver says");
  require(options_.wants_imu && !options_.without_odometry, "--imu-topic", topics_.imu,
          DataType<sensor_msgs::Imu>::value());
  require(options_.wants_velocity && !has_receiver, "--velocity-topic", topics_.velocity, kVelocityTypes);
  require(options_.wants_satellites && !has_receiver, "--satellites-topic", topics_.satellites,
          DataType<SatelliteArray>::value());
}

/// Throws std::runtime_error, which names the point clouds that the bag has, where the one that is wanted has none.
void ReplayInputs::require_clouds() const {
  const std::string wanted = DataType<sensor_msgs::PointCloud2>::value();
  std::string clouds;
  bool has_clouds = false;
  bool has_satellites = driver_ || recording_;
  for (const BagConnection& each : bag_->connections()) {
    const std::string name = without_leading_slash(each.topic);
    has_satellites = has_satellites || name == topics_.satellites;
    if (each.type != wanted) continue;
    has_clouds = has_clouds || name == topics_.points;
    clouds += " " + each.topic;
  }
  if (!has_clouds) {
    throw std::runtime_error(bag_->name() + " has no " + wanted + " on " + topics_.points + " (--points-topic); " +
                             (clouds.empty() ? "it has none on any topic" : "it has them on" + clouds));
  }
  if (has_satellites) return;
  std::cerr << bag_->name() << " has no topic " << topics_.satellites
            << " (--satellites-topic): fixes are weighed by the blocked share of the sky\n";
}

/// Throws std::runtime_error where bag and receiver are of different times.
void ReplayInputs::require_overlap() const {
  if (!messages_ || messages_->size() == 0 || recording_->outputs.empty()) return;
  const auto [from, to] = std::minmax_element(recording_->outputs.begin(), recording_->outputs.end(), is_earlier);
  if (messages_->first_time() <= to->time && from->time <= messages_->last_time()) return;
  throw std::runtime_error(recording_->source + " is of " + format_stamp(from->time) + " to " + format_stamp(to->time) +
                           " s, the rest of " + format_stamp(messages_->first_time()) + " to " +
                           format_stamp(messages_->last_time()) + " s: nothing is of the same time (a wrong date?)");
}

std::size_t ReplayInputs::size() const { return others_.size() + (messages_ ? messages_->size() : 0); }

std::optional<ReceiverRecording> ReplayInputs::receiver() const {
  if (!driver_) return recording_;
  return ReceiverRecording{driver_->source(), driver_->antenna_frame(), {}, driver_->counts(), driver_->unreadable()};
}

bool ReplayInputs::has_transforms_from(const std::string& frame) const {
  BagMessages messages(*bag_, {kTf});
  while (const auto message = messages.next()) {
    const auto transforms = message->instantiate<tf2_msgs::TFMessage>();
    if (!transforms) continue;
    for (const auto& each : transforms->transforms) {
      if (without_leading_slash(each.header.frame_id) == frame) return true;
    }
  }
  return false;
}

bool ReplayInputs::comes_from_bag() {
  const BagMessage* const message = messages_ ? messages_->peek() : nullptr;
  return message != nullptr && (next_other_ == others_.size() || message->time() <= others_[next_other_].time);
}

bool ReplayInputs::is_wanted(Stamp time, bool is_latched) {
  if (!first_) first_ = time;
  const double into_s = to_seconds(time - *first_);
  has_ended_ = into_s > options_.start_s + options_.duration_s;
  if (has_ended_) return false;
  if (is_latched) return true;  // counts from whenever the run begins
  if (into_s < options_.start_s) return false;
  if (!has_begun_) begin_ = time;
  has_begun_ = true;
  last_ = time;
  return true;
}

bool ReplayInputs::give_next(ReplayRun& run) {
  if (!has_ended_ && comes_from_bag()) {
    give(*messages_->next(), run);
    return true;
  }
  if (!has_ended_ && next_other_ < others_.size()) {
    const Input& input = others_[next_other_++];
    if (is_wanted(input.time, false)) input.give_to(run);
    return true;
  }
  if (first_ && !has_begun_)
    throw std::runtime_error((bag_ ? bag_->name() : options_.nmea) + ": has no message after --start");
  return false;
}

void ReplayInputs::give(const BagMessage& message, ReplayRun& run) {
  const std::string name = without_leading_slash(message.getTopic());
  if (driver_ && driver_->decodes(name)) {
    // Also what is cut out, which may tell the date of the rest.
    const ReceiverOutput output = driver_->add(message);
    if (!output.empty() && is_wanted(message.time(), false)) run.add_receiver(output, driver_->antenna_frame());
    return;
  }
  if (!is_wanted(message.time(), is_latched(name))) return;
  if (name == topics_.odom) {
    run.add_odometry(*expect<nav_msgs::Odometry>(message));
  } else if (name == topics_.fix) {
    run.add_fix(*expect<sensor_msgs::NavSatFix>(message));
  } else if (name == topics_.velocity) {
    const auto measured = to_raw_velocity_of(message);
    if (!measured) throw wrong_type(message, kVelocityTypes);
    run.add_velocity(*measured);
  } else if (name == topics_.satellites) {
    run.add_satellites(to_satellite_epoch(*expect<SatelliteArray>(message)));
  } else if (name == topics_.imu) {
    run.add_imu(*expect<sensor_msgs::Imu>(message));
  } else if (name == topics_.points) {
    run.add_cloud(expect<sensor_msgs::PointCloud2>(message));
  } else if (name == kTf) {
    run.add_tf(*expect<tf2_msgs::TFMessage>(message));
  } else if (name == topics::kStaticTf) {
    run.add_static_tf(*expect<tf2_msgs::TFMessage>(message));
  } else if (name == topics_.truth) {
    run.add_truth(*expect<nav_msgs::Odometry>(message));
  } else {
    run.set_datum(*expect<sensor_msgs::NavSatFix>(message));
  }
}

}  // namespace urban_gnss
