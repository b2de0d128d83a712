#include "urban_gnss_localization/pipeline/input_clocks.hpp"

#include <algorithm>
#include <functional>
#include <utility>

#include "limits.hpp"
#include "text.hpp"

namespace urban_gnss {
namespace {

constexpr std::size_t kStreamCount = static_cast<std::size_t>(InputStream::kEstimates) + 1;

std::string clock_of(InputStream stream) { return "the clock of the " + std::string(to_string(stream)); }

}  // namespace

const char* to_string(InputStream stream) {
  switch (stream) {
    case InputStream::kOdometry: return "odometry";
    case InputStream::kFixes: return "fixes";
    case InputStream::kImu: return "IMU";
    case InputStream::kVelocities: return "velocities";
    case InputStream::kEstimates: return "estimates";
  }
  return "?";
}

InputClocks::InputClocks(const StampParameters& parameters, Actions actions)
    : parameters_(parameters),
      actions_(std::move(actions)),
      monitors_(kStreamCount, StampMonitor(parameters.time_jump)) {}

bool InputClocks::accept(InputStream stream, Stamp stamp, const Again& again, std::vector<PipelineEvent>& events) {
  return judge(stream, stamp, again, events) == StampVerdict::kNew;
}

StampVerdict InputClocks::judge(InputStream stream, Stamp stamp, const Again& again, std::vector<PipelineEvent>& events,
                                const Refuse& refuse) {
  const auto before = monitor(stream).last();
  if (before && stamp < *before && !parameters_.reset_on_time_jump) return StampVerdict::kNotNewer;
  const StampVerdict verdict = monitor(stream).judge(stamp, reference_of(stream));
  const bool is_back = before && stamp < *before;
  const std::string why =
      is_back ? clock_of(stream) + " jumped back by " + seconds_text(to_seconds(*before - stamp)) : "";
  if (is_back && (verdict == StampVerdict::kOdd || verdict == StampVerdict::kWentBack) && all_went_back(stream)) {
    const std::vector<Held> held = std::exchange(held_, {});
    reset();
    actions_.reset(why);
    give_again(held);
    return monitor(stream).judge(stamp, reference_of(stream));
  }
  if (verdict == StampVerdict::kNotNewer) return verdict;
  if (verdict == StampVerdict::kOdd) {
    hold({stream, stamp, again, refuse}, events);
    return verdict;
  }
  std::vector<Held> held = release(stream);
  if (verdict == StampVerdict::kWentBack) {
    events.push_back({PipelineEvent::Level::kWarn, why});
    actions_.restart(stream);
  } else if (!held.empty()) {
    // The stream has come as far as those that seemed to be ahead of it: they were not odd.
    const auto was_odd = [&](const Held& each) { return each.stamp >= stamp || each.stamp <= *before; };
    const auto odd = std::stable_partition(held.begin(), held.end(), std::not_fn(was_odd));
    leave_out({odd, held.end()}, *before, events);
    held.erase(odd, held.end());
  }
  if (held.empty()) return StampVerdict::kNew;
  monitor(stream).reset();
  give_again(held);
  return monitor(stream).judge(stamp, reference_of(stream));
}

std::optional<Stamp> InputClocks::reference_of(InputStream stream) {
  return stream == InputStream::kOdometry ? std::nullopt : monitor(InputStream::kOdometry).last();
}

bool InputClocks::all_went_back(InputStream now) const {
  const StampMonitor& odometry = monitors_[static_cast<std::size_t>(InputStream::kOdometry)];
  const auto is_back = [](const StampMonitor& each) { return each.back_in_a_row() > 0; };
  const auto others = std::count_if(monitors_.begin(), monitors_.end(), is_back);
  // The stream itself is not counted any more where its run is at its end.
  const bool has_run = monitors_[static_cast<std::size_t>(now)].run() > 0;
  if (now == InputStream::kOdometry && !has_run) return true;
  return (is_back(odometry) || now == InputStream::kOdometry) && others + (has_run ? 0 : 1) > 1;
}

void InputClocks::hold(Held message, std::vector<PipelineEvent>& events) {
  // Those of a run that ended, without a good stamp between.
  const StampMonitor& stamps = monitor(message.stream);
  if (stamps.run() == 1) leave_out(release(message.stream), *stamps.last(), events);
  if (held_.size() < kMaxWaiting) held_.push_back(std::move(message));
}

std::vector<InputClocks::Held> InputClocks::release(InputStream stream) {
  const auto of_others = [stream](const Held& each) { return each.stream != stream; };
  const auto own = std::stable_partition(held_.begin(), held_.end(), of_others);
  std::vector<Held> released(std::make_move_iterator(own), std::make_move_iterator(held_.end()));
  held_.erase(own, held_.end());
  return released;
}

void InputClocks::leave_out(const std::vector<Held>& odd, Stamp last, std::vector<PipelineEvent>& events) {
  for (const Held& each : odd) {
    ++odd_count_;
    const std::string why = describe_oddness(each.stamp, last);
    if (each.refuse) {
      each.refuse(why);
    } else {
      events.push_back({PipelineEvent::Level::kWarn, std::string(to_string(each.stream)) + " left out: " + why});
    }
  }
}

void InputClocks::give_again(const std::vector<Held>& held) {
  for (const Held& each : held) each.again();
}

void InputClocks::reset() {
  for (StampMonitor& monitor : monitors_) monitor.reset();
}

}  // namespace urban_gnss
