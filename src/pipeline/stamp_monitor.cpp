#include "urban_gnss_localization/pipeline/stamp_monitor.hpp"

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <sstream>

namespace urban_gnss {
namespace {

constexpr int kLongSteps = 5;

}  // namespace

StampVerdict StampMonitor::judge(Stamp stamp, std::optional<Stamp> reference) {
  if (last_ && stamp <= *last_) {
    if (*last_ - stamp <= jump_) return StampVerdict::kNotNewer;
    return add_odd(stamp, true, reference);
  }
  if (is_odd_ahead(stamp, reference)) return add_odd(stamp, false, reference);
  run_ = 0;
  take(stamp, reference);
  return StampVerdict::kNew;
}

bool StampMonitor::is_odd_ahead(Stamp stamp, std::optional<Stamp> reference) const {
  if (!last_ || stamp - *last_ <= jump_) return false;
  if (reference && last_reference_) {
    const Stamp step = std::min(step_.value_or(Stamp(0)), jump_);
    const Stamp lead = std::max(*last_ - *last_reference_, Stamp(0));  // one that is late may catch up
    return stamp - *reference > lead + jump_ + step;
  }
  return step_ && stamp - *last_ > kLongSteps * *step_;
}

/// Whether it goes on from the odd one before it: later, and by no more than a step may be.
StampVerdict StampMonitor::add_odd(Stamp stamp, bool is_back, std::optional<Stamp> reference) {
  const Stamp longest = std::max(jump_, kLongSteps * step_.value_or(jump_));
  const bool goes_on = run_ > 0 && is_run_back_ == is_back && stamp > run_last_ && stamp - run_last_ <= longest;
  if (!goes_on) run_ = 0;
  ++run_;
  is_run_back_ = is_back;
  run_last_ = stamp;
  if (run_ < kConfirm) return StampVerdict::kOdd;
  run_ = 0;
  take(stamp, reference);
  step_.reset();
  return is_back ? StampVerdict::kWentBack : StampVerdict::kWentAhead;
}

void StampMonitor::take(Stamp stamp, std::optional<Stamp> reference) {
  if (last_ && stamp > *last_) step_ = stamp - *last_;
  last_ = stamp;
  last_reference_ = reference;
}

void StampMonitor::reset() {
  run_ = 0;
  last_.reset();
  step_.reset();
  last_reference_.reset();
}

std::string describe_oddness(Stamp stamp, Stamp last) {
  std::ostringstream text;
  text << std::fixed << std::setprecision(3) << "header.stamp " << to_seconds(stamp) << " s is " << std::setprecision(1)
       << std::abs(to_seconds(stamp - last)) << " s " << (stamp < last ? "behind" : "ahead of") << " the last one's";
  return text.str();
}

}  // namespace urban_gnss
