#include "urban_gnss_localization/pipeline/speed_source.hpp"

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <sstream>
#include <utility>

#include "limits.hpp"
#include "urban_gnss_localization/motion/standstill.hpp"

namespace urban_gnss {
namespace {

constexpr double kGlitchHold_s = 2.0;
constexpr double kLeastJump_mps = 1.0;  ///< below it, quantised wheels jump by themselves
constexpr double kMoving_mps = 0.5;
constexpr double kReceiverHold_s = 2.5;  ///< for which a speed of the receiver is used
constexpr double kFixesHold_s = 4.0;     ///< for which one by its fixes is
/// Of the faster of both speeds, the difference and the standard deviation of fixes that agree with the odometry.
constexpr double kTellingShare = 0.25;
constexpr double kTellingSigmas = 4.0;
/// A change of the odometry's speed in one step that is likely to be a fault.
constexpr double kJump_mps = 0.3;
constexpr double kJumpShare = 0.33;
constexpr double kReceiverErrors_s = 2.0;  ///< for which an error of the receiver's speed lasts
constexpr double kFixErrors_s = 5.0;       ///< for which one of the speed by fixes lasts
constexpr double kSpeedWalk = 0.25;        ///< (m/s)^2 per s, of the speed that is filtered
/// A contradiction that is shorter is not worth a word: one that began with a jump of the odometry, and any.
constexpr double kSuspectedJump_s = 1.5;
constexpr double kSuspected_s = 2.5;

std::string describe(SpeedFault fault, const SpeedPair& pair, bool is_by_fixes) {
  std::ostringstream text;
  text << std::fixed << std::setprecision(1) << "the odometry says " << pair.odometry_mps << " m/s, the "
       << (is_by_fixes ? "fixes " : "receiver ") << pair.receiver_mps << " m/s";
  switch (fault) {
    case SpeedFault::kNone: break;
    case SpeedFault::kReversed: text << ": a speed without its sign?"; break;
    case SpeedFault::kDead: text << ": a dead encoder?"; break;
    case SpeedFault::kScaled: text << ": other units, or one wheel dead?"; break;
  }
  return text.str();
}

/// Whether a speed by fixes tells that both agree, or that they do not. Between is more than their noise.
bool tells(const SpeedPair& pair) {
  const double limit = kTellingShare * std::max(std::abs(pair.odometry_mps), std::abs(pair.receiver_mps));
  const double difference = std::abs(pair.odometry_mps - pair.receiver_mps);
  return difference <= limit ? pair.receiver_sigma_mps <= limit : difference > kTellingSigmas * pair.receiver_sigma_mps;
}

}  // namespace

std::optional<double> SpeedSource::odometry_at(Stamp stamp) const {
  if (odometry_.empty() || stamp < odometry_.front().stamp) return std::nullopt;
  for (const Speed& each : odometry_) {
    if (each.stamp >= stamp) return each.mps;
  }
  return std::nullopt;
}

std::optional<double> SpeedSource::odometry_beside(const ReceiverSpeed& receiver) const {
  if (receiver.duration_s == 0.0) return odometry_at(receiver.stamp);
  const Stamp begin = receiver.stamp - from_seconds(receiver.duration_s);
  if (odometry_.empty() || begin < odometry_.front().stamp) return std::nullopt;
  double sum_mps = 0.0;
  int count = 0;
  for (const Speed& each : odometry_) {
    if (each.stamp <= begin || each.stamp > receiver.stamp) continue;
    sum_mps += each.mps;
    ++count;
  }
  return count > 0 ? std::optional<double>(sum_mps / count) : std::nullopt;
}

void SpeedSource::compare(const ReceiverSpeed& receiver, std::vector<PipelineEvent>& events) {
  const auto odometry_mps = odometry_beside(receiver);
  if (!parameters_.check_wheels || !odometry_mps) return;
  // A heading that was never right must not turn the speed's sign.
  if (receiver.forward_mps && *receiver.forward_mps * *odometry_mps > kMoving_mps * kMoving_mps) has_agreed_ = true;
  const bool has_sign = has_agreed_ && receiver.forward_mps;
  if (!has_sign && check_.fault() == SpeedFault::kReversed) return;  // of a speed without a sign one sees nothing
  const bool is_backwards = *odometry_mps < -kStandstillMean_mps;
  const double receiver_mps =
      has_sign ? *receiver.forward_mps : (is_backwards ? -receiver.speed_mps : receiver.speed_mps);
  const bool has_jumped = jumped_ && *jumped_ <= receiver.stamp;
  if (has_jumped) jumped_.reset();
  const SpeedPair pair{receiver.stamp,     *odometry_mps, receiver_mps,
                       receiver.sigma_mps, has_jumped,    receiver.duration_s > 0.0};
  is_by_fixes_ = pair.is_by_fixes;
  if (is_by_fixes_) filter(pair);
  if (is_by_fixes_ && !tells(pair)) return;
  pair_ = pair;
  const SpeedFault before = check_.fault();
  const SpeedFault fault = check_.add(pair_);
  if (fault != SpeedFault::kNone && std::abs(pair_.odometry_mps - pair_.receiver_mps) > kMoving_mps) shown_ = pair_;
  if (fault == before) return;
  last_mps_.reset();
  const bool is_fine = fault == SpeedFault::kNone;
  const char* what_follows = is_by_fixes_ ? " The fixes' speed is used" : " The receiver's speed is used";
  events.push_back({is_fine ? PipelineEvent::Level::kInfo : PipelineEvent::Level::kWarn,
                    describe(fault, pair_, is_by_fixes_) + (is_fine ? ": both agree again" : what_follows)});
}

void SpeedSource::filter(const SpeedPair& pair) {
  const double variance = pair.receiver_sigma_mps * pair.receiver_sigma_mps;
  if (!by_fixes_ || to_seconds(pair.stamp - by_fixes_->stamp) > kFixesHold_s) {
    by_fixes_ = FilteredSpeed{pair.stamp, pair.receiver_mps, variance};
    return;
  }
  const double predicted = by_fixes_->variance + kSpeedWalk * to_seconds(pair.stamp - by_fixes_->stamp);
  const double gain = predicted / (predicted + variance);
  by_fixes_ =
      FilteredSpeed{pair.stamp, by_fixes_->mps + gain * (pair.receiver_mps - by_fixes_->mps), (1.0 - gain) * predicted};
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

bool SpeedSource::is_fresh(Stamp stamp) const {
  if (is_by_fixes_) return by_fixes_ && to_seconds(stamp - by_fixes_->stamp) <= kFixesHold_s;
  return to_seconds(stamp - pair_.stamp) <= kReceiverHold_s;
}

double SpeedSource::doubt_of(double odometry_mps, double believed_mps, Stamp stamp, double duration_s) {
  if (is_wrong() && is_fresh(stamp)) {
    doubt_.end();
    if (is_by_fixes_) return 2.0 * kFixErrors_s * by_fixes_->variance * duration_s;
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
  if (is_wrong() && is_fresh(stamp)) return receiver_mps();
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
  if (check_.fault() != SpeedFault::kNone) return describe(check_.fault(), shown_, is_by_fixes_);
  if (odometry_.empty() || !is_fresh(odometry_.back().stamp)) return {};
  const double least_s = check_.began_with_a_jump() ? kSuspectedJump_s : kSuspected_s;
  return check_.suspected_for_s() >= least_s ? describe(SpeedFault::kNone, pair_, is_by_fixes_) : std::string();
}

}  // namespace urban_gnss
