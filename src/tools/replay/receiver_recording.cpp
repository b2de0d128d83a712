#include "receiver_recording.hpp"

#include <algorithm>

#include "urban_gnss_localization/pipeline/velocity_odometry.hpp"

namespace urban_gnss {
namespace {

std::optional<Stamp> newest_of(const ReceiverOutput& output) {
  std::optional<Stamp> newest;
  const auto take = [&](Stamp stamp) { newest = newest ? std::max(*newest, stamp) : stamp; };
  for (const RawFix& fix : output.fixes) take(fix.stamp);
  for (const RawVelocity& velocity : output.velocities) take(velocity.stamp);
  return newest;
}

}  // namespace

std::vector<TimedOdometry> odometry_of(const ReceiverRecording& recording) {
  std::vector<RawFix> fixes;
  std::vector<RawVelocity> velocities;
  for (const TimedOutput& each : recording.outputs) {
    fixes.insert(fixes.end(), each.output.fixes.begin(), each.output.fixes.end());
    velocities.insert(velocities.end(), each.output.velocities.begin(), each.output.velocities.end());
  }
  const std::vector<OdometrySample> samples =
      odometry_of_velocities(velocities.empty() ? velocities_of_fixes(fixes) : velocities);
  std::vector<TimedOdometry> timed;
  auto output = recording.outputs.begin();
  for (const OdometrySample& sample : samples) {
    const auto is_older = [&](const TimedOutput& each) {
      const auto newest = newest_of(each.output);
      return !newest || *newest < sample.stamp;
    };
    output = std::find_if_not(output, recording.outputs.end(), is_older);
    const Stamp time = output != recording.outputs.end() ? output->time : recording.outputs.back().time;
    timed.push_back({time, sample});
  }
  return timed;
}

}  // namespace urban_gnss
