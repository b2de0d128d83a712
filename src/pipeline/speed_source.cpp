#include "urban_gnss_localization/pipeline/speed_source.hpp"

#include <algorithm>
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
/// A change of the odometry's speed in one step that is likely to be a fault.
constexpr double kJump_mps = 0.3;
constexpr double kJumpShare = 0.33;
constexpr double kReceiverErrors_s = 2.0;  ///< for which an error of the receiver's speed lasts
/// A contradiction that is shorter is not worth a word: one that began with a jump of the odometry, and any.
constexpr double kSuspectedJump_s = 1.5;
constexpr double kSuspected_s = 2.5;

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
  const bool has_jumped = jumped_ && *jumped_ <= receiver.stamp;
  if (has_jumped) jumped_.reset();
  pair_ = {receiver.stamp, *odometry_mps, receiver_mps, receiver.sigma_mps, has_jumped};
  const SpeedFault before = check_.fault();
  const SpeedFault fault = check_.add(pair_);
  if (fault != SpeedFault::kNone && std::abs(pair_.odometry_mps - pair_.receiver_mps) > kMoving_mps) shown_ = pair_;
  if (fault == before) return;
  last_mps_.reset();
  const bool is_fine = fault == SpeedFault::kNone;
  events.push_back({is_fine ? PipelineEvent::Level::kInfo : PipelineEvent::Level::kWarn,
                    describe(fault, pair_) + (is_fine ? ": both agree again" : " The receiver's speed is used")});
}

void SpeedSource::note(double odometry_mps, Stamp stamp) {
  if (!odometry_.empty()) {
    const double before_mps = odometry_.back().mps;
    const double faster_mps = std::max(std::abs(odometry_mps), std::abs(before_mps));
    if (std::abs(odometry_mps - before_mps) > std::max(kJump_mps, kJumpShare * faster_mps)) jumped_ = stamp;
  }
  odometry_.push_back({stamp, odometry_mps});
  while (to_seconds(stamp - odometry_.front().stamp) > kHistory_s) odometry_.pop_front();
}

double SpeedSource::speed_of(double odometry_mps, Stamp stamp, double duration_s, std::vector<PipelineEvent>& events) {
  note(odometry_mps, stamp);
  const double believed = believed_mps(odometry_mps, stamp, duration_s, events);
  doubt_m2_ = doubt_of(odometry_mps, believed, stamp, duration_s);
  return believed;
}

bool SpeedSource::is_fresh(Stamp stamp) const { return to_seconds(stamp - pair_.stamp) <= kReceiverHold_s; }

double SpeedSource::doubt_of(double odometry_mps, double believed_mps, Stamp stamp, double duration_s) {
  if (is_wrong() && is_fresh(stamp)) {
    doubt_.end();
    return 2.0 * kReceiverErrors_s * pair_.receiver_sigma_mps * pair_.receiver_sigma_mps * duration_s;
  }
  const bool is_suspected = check_.suspected_for_s() > 0.0 && check_.began_with_a_jump() && is_fresh(stamp);
  if (is_wrong() || is_suspected) {
    const double difference_mps = std::max(std::abs(pair_.receiver_mps - believed_mps), std::abs(odometry_mps));
    return doubt_.grow(difference_mps * duration_s);
  }
  doubt_.end();
  return 0.0;
}

double SpeedSource::believed_mps(double odometry_mps, Stamp stamp, double duration_s,
                                 std::vector<PipelineEvent>& events) {
  if (is_wrong() && is_fresh(stamp)) return pair_.receiver_mps;
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
  if (check_.fault() != SpeedFault::kNone) return describe(check_.fault(), shown_);
  if (odometry_.empty() || !is_fresh(odometry_.back().stamp)) return {};
  const double least_s = check_.began_with_a_jump() ? kSuspectedJump_s : kSuspected_s;
  return check_.suspected_for_s() >= least_s ? describe(SpeedFault::kNone, pair_) : std::string();
}

}  // namespace urban_gnss
