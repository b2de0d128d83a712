#include "urban_gnss_localization/receivers/receiver_input.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>

#include "urban_gnss_localization/common/covariance_faults.hpp"

namespace urban_gnss {
namespace {

constexpr std::size_t kMaxRecent = 100;
constexpr double kClockSetBack_s = 1.0;

/// Whether a message's float can hold it.
bool is_float(double value) { return std::abs(value) <= std::numeric_limits<float>::max(); }

void make_sound(RawFix& fix) {
  if (!std::isfinite(fix.position.latitude_deg) || !std::isfinite(fix.position.longitude_deg)) {
    fix.position = {};
    fix.has_fix = false;
  }
  if (std::isinf(fix.position.altitude_m)) fix.position.altitude_m = std::numeric_limits<double>::quiet_NaN();
  if (!covariance_fault(fix.covariance, {"east", "north", "up"}).empty()) {
    fix.covariance.setZero();
    fix.covariance_type = CovarianceType::kUnknown;
  }
}

void make_sound(SatelliteObservation& satellite) {
  for (double* each :
       {&satellite.look.azimuth_rad, &satellite.look.elevation_rad, &satellite.cn0_dbhz, &satellite.residual_m}) {
    if (!is_float(*each)) *each = SatelliteObservation::kUnknown;
  }
}

}  // namespace

void make_sound(ReceiverOutput& output) {
  for (RawFix& fix : output.fixes) make_sound(fix);
  std::vector<RawVelocity>& velocities = output.velocities;
  velocities.erase(std::remove_if(velocities.begin(), velocities.end(),
                                  [](const RawVelocity& each) { return !each.velocity.allFinite(); }),
                   velocities.end());
  for (RawVelocity& velocity : velocities) {
    if (!covariance_fault(velocity.covariance, {"east", "north"}).empty()) velocity.covariance.setZero();
  }
  for (SatelliteEpoch& epoch : output.satellites) {
    if (!is_float(epoch.angle_resolution_rad)) epoch.angle_resolution_rad = 0.0;
    for (SatelliteObservation& satellite : epoch.satellites) make_sound(satellite);
  }
}

ReceiverCounter::Solution& ReceiverCounter::at(Stamp stamp) {
  const auto known =
      std::find_if(recent_.rbegin(), recent_.rend(), [&](const auto& each) { return each.stamp == stamp; });
  if (known != recent_.rend()) return *known;
  recent_.push_back({stamp});
  if (recent_.size() > kMaxRecent) recent_.pop_front();
  return recent_.back();
}

void ReceiverCounter::update(Solution& solution, const Solution& before) {
  const auto gained = [&](bool Solution::*what) {
    return solution.has_fix && solution.*what && !(before.has_fix && before.*what) ? 1U : 0U;
  };
  counts_.fixes_with_satellites += gained(&Solution::has_satellites);
  counts_.fixes_with_residuals += gained(&Solution::has_residuals);
}

void ReceiverCounter::add(const ReceiverOutput& output) {
  counts_.velocities += output.velocities.size();
  for (const RawFix& fix : output.fixes) {
    ++(fix.has_fix ? counts_.fixes : counts_.no_fixes);
    if (!fix.has_fix) continue;
    Solution& solution = at(fix.stamp);
    const Solution before = solution;
    solution.has_fix = true;
    update(solution, before);
  }
  for (const SatelliteEpoch& epoch : output.satellites) {
    Solution& solution = at(epoch.stamp);
    const Solution before = solution;
    solution.has_epoch = true;
    solution.has_satellites = solution.has_satellites || !epoch.satellites.empty();
    solution.has_residuals =
        solution.has_residuals || std::any_of(epoch.satellites.begin(), epoch.satellites.end(),
                                              [](const auto& each) { return std::isfinite(each.residual_m); });
    if (!before.has_epoch) ++counts_.epochs;
    update(solution, before);
  }
}

ReceiverInput::ReceiverInput(const ReceiverPreset& preset) : preset_(&preset) {
  if (preset.make == nullptr) throw std::invalid_argument("receiver " + preset.name + " has no decoder");
  decoder_ = preset.make();
}

const MessageDefinition& ReceiverInput::definition_of(const MessageConnection& connection) {
  const std::string key = connection.topic + '\n' + connection.type + '\n' + connection.md5;
  std::unique_ptr<MessageDefinition>& known = definitions_[key];
  if (!known) known = std::make_unique<MessageDefinition>(connection.type, connection.md5, connection.definition);
  return *known;
}

void ReceiverInput::add(const ReceiverTopic& topic, const MessageConnection& connection, const std::uint8_t* data,
                        std::size_t size, Stamp arrival) {
  ++received_[connection.topic];
  if (to_seconds(last_arrival_ - arrival) > kClockSetBack_s) {
    decoder_ = preset_->make();
    warnings_.push_back("the clock was set back: receiver " + preset_->name + " begins anew");
  }
  last_arrival_ = arrival;
  try {
    const MessageView message(definition_of(connection), data, size);
    const bool is_of_antenna = topic.role == ReceiverRole::kFix || topic.role == ReceiverRole::kGpsFix ||
                               topic.role == ReceiverRole::kSentence;
    if (is_of_antenna && message.has_text("header.frame_id")) {
      std::string frame = message.text("header.frame_id");
      if (!frame.empty()) frame_id_ = std::move(frame);
    }
    decoder_->add(topic.role, message, arrival);
  } catch (const MessageError& error) {
    note_error(connection, error.what());
  }
}

void ReceiverInput::note_error(const MessageConnection& connection, const std::string& error) {
  ++unreadable_[connection.topic];
  last_error_ = connection.topic + ": " + error;
  const bool is_new = said_.size() < kMaxRecent && said_.insert(last_error_).second;
  if (is_new) warnings_.push_back(last_error_ + "; left out");
}

void ReceiverInput::finish() { decoder_->finish(); }

ReceiverOutput ReceiverInput::take() {
  ReceiverOutput output = decoder_->take();
  std::vector<std::string> warnings = std::exchange(warnings_, {});
  output.warnings.insert(output.warnings.begin(), warnings.begin(), warnings.end());
  make_sound(output);
  counter_.add(output);
  return output;
}

}  // namespace urban_gnss
