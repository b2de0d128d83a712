#include "urban_gnss_localization/motion/speed_check.hpp"

#include <algorithm>
#include <cmath>

#include "urban_gnss_localization/motion/standstill.hpp"

namespace urban_gnss {
namespace {

constexpr double kTolerance_mps = 0.5;
/// Where both move, the receiver's sigma tells more.
constexpr double kMovingTolerance_mps = 0.25;
constexpr double kTolerance = 0.25;  ///< relative to the larger speed
constexpr double kSigmas = 4.0;
/// Both speeds are compared by their ratio beyond it.
constexpr double kLeast_mps = 0.3;
/// By which the ratio of a scaled speed may change, and how quickly its mean follows.
constexpr double kSteadyRatio = 0.3;
constexpr double kSteadySigmas = 3.0;
constexpr double kRatioRate = 0.2;
/// By which the receiver's speed may change while the wheels are dead.
constexpr double kSteadySpeed = 2.0;
/// A scale that is no error of tyres: miles and kilometres an hour, one wheel of two.
constexpr double kGross = 1.8;
constexpr double kSilence_s = 2.5;
/// From a speed below it, a robot can turn back within kTurn_s.
constexpr double kSlow_mps = 1.0;
constexpr double kTurn_s = 3.0;

/// For which a fault must last; `ratio` of the receiver's speed to the odometry's.
double least_time_s(SpeedFault fault, double ratio, bool odometry_jumped, bool is_by_fixes) {
  switch (fault) {
    case SpeedFault::kNone: return is_by_fixes ? 6.0 : 1.5;
    case SpeedFault::kReversed: return 1.5;
    case SpeedFault::kDead: return 4.0;
    case SpeedFault::kScaled: {
      const bool is_gross = ratio > kGross || ratio < 1.0 / kGross;
      return (is_gross ? 4.0 : 10.0) * (odometry_jumped ? 0.5 : 1.0);
    }
  }
  return 0.0;
}

}  // namespace

std::optional<SpeedFault> SpeedCheck::pattern_of(const SpeedPair& pair) const {
  const double odometry = std::abs(pair.odometry_mps);
  const double receiver = std::abs(pair.receiver_mps);
  const double least = std::min(odometry, receiver) < kLeast_mps ? kTolerance_mps : kMovingTolerance_mps;
  const double tolerance =
      std::max({least, kTolerance * std::max(odometry, receiver), kSigmas * pair.receiver_sigma_mps});
  if (std::abs(pair.odometry_mps - pair.receiver_mps) <= tolerance) return SpeedFault::kNone;
  if (odometry < kStandstillMean_mps) return SpeedFault::kDead;
  if (std::abs(pair.odometry_mps + pair.receiver_mps) <= tolerance) {
    const bool may_have_turned = turned_ && to_seconds(pair.stamp - *turned_) <= kTurn_s;
    if (may_have_turned || run_ == SpeedFault::kReversed) return SpeedFault::kReversed;
    return std::nullopt;
  }
  if (pair.odometry_mps * pair.receiver_mps <= 0.0 || odometry < kLeast_mps || receiver < kLeast_mps) {
    return std::nullopt;
  }
  return SpeedFault::kScaled;
}

bool SpeedCheck::is_steady(const SpeedPair& pair) const {
  switch (*run_) {
    case SpeedFault::kNone:
    case SpeedFault::kReversed: return true;
    case SpeedFault::kDead: {
      const double change = std::abs(pair.receiver_mps / first_->receiver_mps);
      return change < kSteadySpeed && change > 1.0 / kSteadySpeed;
    }
    case SpeedFault::kScaled: {
      const double scaled_mps = ratio_ * pair.odometry_mps;
      return std::abs(pair.receiver_mps - scaled_mps) <=
             std::max(kSteadyRatio * std::abs(scaled_mps), kSteadySigmas * pair.receiver_sigma_mps);
    }
  }
  return false;
}

double SpeedCheck::run_s() const { return first_ && last_ ? to_seconds(last_->stamp - first_->stamp) : 0.0; }

double SpeedCheck::suspected_for_s() const {
  return run_ && *run_ != SpeedFault::kNone && *run_ != fault_ ? run_s() : 0.0;
}

SpeedFault SpeedCheck::add(const SpeedPair& pair) {
  // Where both stand, any wheels agree.
  if (std::max(std::abs(pair.odometry_mps), std::abs(pair.receiver_mps)) < kTolerance_mps) {
    if (run_ != fault_) run_.reset();  // what was suspected is not any more
    return fault_;
  }
  const bool is_slow = std::abs(pair.odometry_mps) < kSlow_mps;
  if (is_slow || (last_ && pair.odometry_mps * last_->odometry_mps < 0.0)) turned_ = pair.stamp;
  const auto pattern = pattern_of(pair);
  const bool goes_on =
      pattern && pattern == run_ && to_seconds(pair.stamp - last_->stamp) <= kSilence_s && is_steady(pair);
  if (!goes_on) {
    const bool is_same = pattern && pattern == run_;
    odometry_jumped_ = pair.odometry_jumped || (is_same && odometry_jumped_);
    first_ = pair;
    run_ = pattern;
    count_ = 1;
    ratio_ = pattern == SpeedFault::kScaled ? pair.receiver_mps / pair.odometry_mps : 1.0;
  } else if (run_ == SpeedFault::kScaled) {
    ratio_ += std::max(kRatioRate, 1.0 / ++count_) * (pair.receiver_mps / pair.odometry_mps - ratio_);
  }
  last_ = pair;
  if (run_ && run_s() >= least_time_s(*run_, ratio_, odometry_jumped_, pair.is_by_fixes)) fault_ = *run_;
  return fault_;
}

}  // namespace urban_gnss
