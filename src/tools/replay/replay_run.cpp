#include "replay_run.hpp"

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <iostream>
#include <limits>
#include <utility>

#include "urban_gnss_localization/evaluation/tum.hpp"
#include "urban_gnss_localization/geometry/angles.hpp"
#include "urban_gnss_localization/ros/conversions.hpp"
#include "urban_gnss_localization/ros/receiver_messages.hpp"
#include "urban_gnss_localization/ros/topics.hpp"

namespace urban_gnss {
namespace {

constexpr double kNever = std::numeric_limits<double>::quiet_NaN();
constexpr std::size_t kMostLines = 3;           // of one kind; the others are counted
constexpr std::size_t kMostReserved = 1000000;  // whatever a damaged index says
constexpr double kKnownHeading_rad = degrees_to_radians(10.0);

}  // namespace

ReplayRun::ReplayRun(const ReplayOptions& options, const ReplaySettings& settings, const InputFiles& files,
                     const RecordingFacts& recording)
    : shell_(settings.localizer.shell),
      pipeline_(shell_.localization, settings.localizer.localizer->make()),
      slew_(shell_.slew),
      sensor_frames_(shell_.frames, shell_.antenna_offset_from_tf, shell_.localization.input.antenna()),
      bias_responder_(settings.gps_bias.bias.bias),
      has_truth_(recording.truths > 0) {
  if (has_truth_) {
    truth_.reserve(std::min(recording.truths, kMostReserved));
    estimate_.reserve(std::min(recording.odometries, kMostReserved));
  }
  if (settings.occlusion) occlusion_.emplace(*settings.occlusion, recording.odometry_is_tf);
  if (!options.output.empty()) bag_ = std::make_unique<OutputBag>(options.output, files);
  if (!options.tum_file.empty()) tum_ = std::make_unique<OutputFile>(options.tum_file, files);
}

void ReplayRun::add_odometry(const OdometrySample& sample) {
  newest_ = sample.stamp;
  if (!begin_) begin_ = newest_;
  pipeline_.add_odometry(sample);
  settle();
}

void ReplayRun::add_odometry(const nav_msgs::Odometry& message) {
  sensor_frames_.observe_odometry(message.header.frame_id, message.child_frame_id);
  add_odometry(to_odometry_sample(message));
  if (!occlusion_) return;
  occlusion_->add_odometry(message);
  take_weighed();
}

void ReplayRun::add_imu(const sensor_msgs::Imu& message) {
  sensor_frames_.observe_imu(message.header.frame_id);
  look_up_sensors();
  const auto sample = to_imu_sample(message);
  if (!sample) return;
  pipeline_.add_imu(*sample);
  if (occlusion_) occlusion_->add_imu(*sample, without_leading_slash(message.header.frame_id));
}

void ReplayRun::add_static_tf(const tf2_msgs::TFMessage& message) {
  for (geometry_msgs::TransformStamped transform : message.transforms) {
    transform.header.frame_id = without_leading_slash(transform.header.frame_id);
    transform.child_frame_id = without_leading_slash(transform.child_frame_id);
    tf_.setTransform(transform, "bag", true);
  }
  if (!occlusion_) return;
  occlusion_->add_tf(message, true);
  take_weighed();
}

void ReplayRun::add_tf(const tf2_msgs::TFMessage& message) {
  occlusion_->add_tf(message, false);
  take_weighed();
}

void ReplayRun::add_cloud(const sensor_msgs::PointCloud2ConstPtr& message) {
  occlusion_->add_cloud(message);
  take_weighed();
}

void ReplayRun::look_up_sensors() {
  if (!sensor_frames_.is_complete()) sensor_frames_.look_up(tf_, pipeline_);
}

void ReplayRun::add_fix(const RawFix& fix) {
  pipeline_.add_fix(fix);
  settle();
}

void ReplayRun::add_fix(const sensor_msgs::NavSatFix& message) {
  write(topics::kFix, newest_ == Stamp(0) ? to_stamp(message.header.stamp) : newest_, message);
  if (!occlusion_) return give(message);
  occlusion_->add_fix(message);
  take_weighed();
}

void ReplayRun::take_weighed() {
  print(occlusion_->take_events());
  for (const WeighedMessage& weighed : occlusion_->take()) {
    const Stamp stamp = to_stamp(weighed.fix.header.stamp);
    write(topics::kWeightedFix, stamp, weighed.fix);
    if (weighed.visibility) write(topics::kVisibility, stamp, *weighed.visibility);
    give(weighed.fix);
  }
}

void ReplayRun::give(const sensor_msgs::NavSatFix& message) {
  sensor_frames_.observe_fix(message.header.frame_id);
  look_up_sensors();
  add_fix(to_raw_fix(message));
}

void ReplayRun::add_velocity(const RawVelocity& velocity) {
  pipeline_.add_velocity(velocity);
  settle();
}

void ReplayRun::add_satellites(const SatelliteEpoch& epoch) {
  pipeline_.add_satellites(epoch.stamp, epoch.satellites);
  settle();
  if (!occlusion_) return;
  occlusion_->add_satellites(epoch);
  take_weighed();
}

void ReplayRun::set_datum(const sensor_msgs::NavSatFix& message) {
  bag_datum_ = to_geodetic(message);
  if (!pipeline_.frame()) pipeline_.set_datum(*bag_datum_);
  settle();
}

void ReplayRun::add_truth(const nav_msgs::Odometry& message) { truth_.push_back(to_timed_pose(message)); }

void ReplayRun::add_receiver(const ReceiverOutput& output, const std::string& antenna_frame) {
  for (const std::string& warning : output.warnings) std::cerr << "replay: " << warning << '\n';
  for (const RawFix& fix : output.fixes) {
    const sensor_msgs::NavSatFix message = to_message(fix, antenna_frame);
    if (occlusion_) {
      add_fix(message);
    } else {
      write(topics::kFix, newest_ == Stamp(0) ? fix.stamp : newest_, message);
      add_fix(fix);
    }
  }
  for (const RawVelocity& velocity : output.velocities) add_velocity(velocity);
  for (const SatelliteEpoch& epoch : output.satellites) add_satellites(epoch);
}

void ReplayRun::finish() {
  if (occlusion_) {
    occlusion_->finish();
    take_weighed();
  }
  for (const auto& [kind, texts] : events_.kinds()) {
    if (texts.count > kMostLines) std::cerr << texts.count - kMostLines << " more like: " << texts.first << '\n';
  }
  if (bag_) bag_->close();
  if (tum_) tum_->close();
}

double ReplayRun::since_begin_s(const std::optional<Stamp>& stamp) const {
  return stamp && begin_ ? to_seconds(*stamp - *begin_) : kNever;
}

std::optional<Trajectory> ReplayRun::take_truth() {
  if (truth_.empty() || !pipeline_.frame()) return std::nullopt;
  if (!bag_datum_) {
    std::cerr << "replay: the bag has a truth but no gps/datum; the truth is taken to be in the frame of the datum\n";
    return std::move(truth_);
  }
  Trajectory moved = std::move(truth_);
  if (!(*bag_datum_ == pipeline_.frame()->datum())) {
    const LocalFrame theirs(*bag_datum_);
    for (TimedPose& timed : moved) {
      const Eigen::Vector3d point = pipeline_.frame()->to_local(theirs.to_geodetic({timed.pose.x, timed.pose.y, 0.0}));
      timed.pose.x = point.x();
      timed.pose.y = point.y();
    }
  }
  sort_by_stamp(moved);
  return moved;
}

void ReplayRun::settle() {
  write_biases(bias_responder_.answer(pipeline_));
  print(sensor_frames_.take_events());
  print(pipeline_.take_events());
  for (const LocalizationOutput& output : pipeline_.take_outputs()) take(output);
  write_biases(pipeline_.take_bias_estimates());
  const std::vector<FixOutcome> outcomes = pipeline_.take_outcomes();
  for (const FixOutcome& outcome : outcomes) {
    const std::string decision = to_string(outcome.decision);
    ++decisions_[decision];
    if (is_rejected(outcome.decision)) rejections_.add(decision + ": " + outcome.reason);
  }
  if (bag_) write_status(outcomes);
}

void ReplayRun::write_status(const std::vector<FixOutcome>& outcomes) {
  const auto messages = to_status_messages(pipeline_, outcomes, to_ros(newest_), shell_.frames.map);
  for (const auto& message : messages) write(topics::kStatus, newest_, message);
  if (!messages.empty()) last_status_ = newest_;
  if (std::chrono::abs(newest_ - last_status_) < from_seconds(kStatusPeriod_s)) return;
  last_status_ = newest_;
  write(topics::kStatus, newest_,
        to_message(pipeline_.report(), pipeline_.localizer(), to_ros(newest_), shell_.frames.map));
}

void ReplayRun::take(const LocalizationOutput& output) {
  const TimedPose pose{output.stamp, output.estimate.pose, output.estimate.covariance};
  ++estimates_;
  if (!first_estimate_) first_estimate_ = output.stamp;
  if (!first_heading_ && std::sqrt(pose.covariance(2, 2)) < kKnownHeading_rad) first_heading_ = output.stamp;
  if (has_truth_) estimate_.push_back(pose);
  if (tum_) write_tum(tum_->stream(), {pose});
  if (!bag_ && !occlusion_) return;
  write_datum(output.stamp);
  write(topics::kEstimate, output.stamp, to_message(output, shell_.frames));
  write(topics::kFilteredFix, output.stamp, to_fix_message(output, *pipeline_.frame(), shell_.frames));
  tf2_msgs::TFMessage tf;
  tf.transforms.push_back(
      to_map_to_odom(slew_.follow(output), output.stamp, shell_.frames, shell_.transform_time_offset));
  write(kTf, output.stamp, tf);
  if (occlusion_) occlusion_->add_estimate(output, tf.transforms.front());
}

void ReplayRun::print(const std::vector<PipelineEvent>& events) {
  for (const PipelineEvent& event : events) {
    if (events_.add(event.text) > kMostLines) continue;
    std::cerr << "[" << std::fixed << std::setprecision(3) << to_seconds(newest_) << "] " << event.text << '\n';
  }
}

void ReplayRun::write_biases(const std::vector<BiasEstimate>& biases) {
  for (const BiasEstimate& bias : biases) {
    write(topics::kBias, bias.stamp, to_message(bias, shell_.frames.map));
  }
}

void ReplayRun::write_datum(Stamp stamp) {
  const GeodeticPosition& datum = pipeline_.frame()->datum();
  if (written_datum_ && *written_datum_ == datum) return;
  written_datum_ = datum;
  write(topics::kDatum, stamp, to_message(datum, to_ros(stamp), shell_.frames.map));
}

template <class M>
void ReplayRun::write(const std::string& topic, Stamp stamp, const M& message) {
  if (bag_) bag_->write("/" + topic, std::max(to_ros(stamp), ros::TIME_MIN), message);
}

}  // namespace urban_gnss
