#include "urban_gnss_localization/pipeline/speed_source.hpp"

#include <cmath>
#include <iomanip>
#include <sstream>

#include "limits.hpp"
#include "urban_gnss_localization/motion/standstill.hpp"

namespace urban_gnss {
namespace {

constexpr double kGlitchHold_s = 2.0;
constexpr double kLeastJump_mps = 1.0;  ///< below it, quantised wheels jump by themselves
constexpr double kMoving_mps = 0.5;
constexpr double kReceiverHold_s = 2.5;  ///< for which a speed of the receiver is used

std::string describe(SpeedFault fault, const SpeedPair& pair) {
  std::ostringstream text;
  text << std::fixed << std::setprecision(1) << "the odometry says " << pair.odometry_mps << " m/s, the receiver "
       << pair.receiver_mps << " m/s";
  switch (fault) {
    case SpeedFault::kNone: break;
    case SpeedFault::kReversed: text << ": a speed without its sign?"; break;
    case SpeedFault::kDead: text << ": a dead encoder?"; break;
    case SpeedFault::kScaled: text << ": other units, or one wheel dead?"; break;
  }
  return text.str();
}

}  // namespace

std::optional<double> SpeedSource::odometry_at(Stamp stamp) const {
  if (odometry_.empty() || stamp < odometry_.front().stamp) return std::nullopt;
  for (const Speed& each : odometry_) {
    if (each.stamp >= stamp) return each.mps;
  }
  return std::nullopt;
}

void SpeedSource::compare(const ReceiverSpeed& receiver, std::vector<PipelineEvent>& events) {
  const auto odometry_mps = odometry_at(receiver.stamp);
  if (!parameters_.check_wheels || !odometry_mps) return;
  // A heading that was never right must not turn the speed's sign.
  if (receiver.forward_mps && *receiver.forward_mps * *odometry_mps > kMoving_mps * kMoving_mps) has_agreed_ = true;
  const bool has_sign = has_agreed_ && receiver.forward_mps;
  const bool is_backwards = *odometry_mps < -kStandstillMean_mps;
  const double receiver_mps =
      has_sign ? *receiver.forward_mps : (is_backwards ? -receiver.speed_mps : receiver.speed_mps);
  pair_ = {receiver.stamp, *odometry_mps, receiver_mps, receiver.sigma_mps};
  const SpeedFault before = check_.fault();
  const SpeedFault fault = check_.add(pair_);
  if (fault != SpeedFault::kNone && std::abs(pair_.odometry_mps - pair_.receiver_mps) > kMoving_mps) shown_ = pair_;
  if (fault == before) return;
  last_mps_.reset();
  const bool is_fine = fault == SpeedFault::kNone;
  events.push_back({is_fine ? PipelineEvent::Level::kInfo : PipelineEvent::Level::kWarn,
                    describe(fault, pair_) + (is_fine ? ": both agree again" : " The receiver's speed is used")});
}

double SpeedSource::speed_of(double odometry_mps, Stamp stamp, double duration_s, std::vector<PipelineEvent>& events) {
  odometry_.push_back({stamp, odometry_mps});
  while (to_seconds(stamp - odometry_.front().stamp) > kHistory_s) odometry_.pop_front();
  const bool is_wrong = check_.fault() != SpeedFault::kNone;
  if (is_wrong && to_seconds(stamp - pair_.stamp) <= kReceiverHold_s) return pair_.receiver_mps;
  const double speed_mps = check_.fault() == SpeedFault::kReversed ? -odometry_mps : odometry_mps;
  return without_glitch(speed_mps, duration_s, events);
}

double SpeedSource::without_glitch(double odometry_mps, double duration_s, std::vector<PipelineEvent>& events) {
  const double most = kLeastJump_mps + parameters_.max_acceleration * (duration_s + held_s_);
  const bool jumps = last_mps_ && std::abs(odometry_mps - *last_mps_) > most;
  const bool returns = before_jump_mps_ && std::abs(odometry_mps - *before_jump_mps_) <= most;
  if (jumps && !returns && held_s_ + duration_s <= kGlitchHold_s) {
    if (held_s_ == 0.0) {
      std::ostringstream text;
      text << std::fixed << std::setprecision(1) << "speed of the odometry left out: from " << *last_mps_ << " to "
           << odometry_mps << " m/s at once";
      events.push_back({PipelineEvent::Level::kWarn, text.str()});
    }
    held_s_ += duration_s;
    return *last_mps_;
  }
  if (jumps) before_jump_mps_ = returns ? std::nullopt : last_mps_;
  held_s_ = 0.0;
  last_mps_ = odometry_mps;
  return odometry_mps;
}

std::string SpeedSource::complaint() const {
  return check_.fault() == SpeedFault::kNone ? std::string() : describe(check_.fault(), shown_);
}

}  // namespace urban_gnss
