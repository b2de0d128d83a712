#include "urban_gnss_localization/pipeline/fix_queue.hpp"

#include <chrono>
#include <utility>

#include "limits.hpp"
#include "urban_gnss_localization/gnss/position_hint.hpp"

namespace urban_gnss {
namespace {

constexpr Stamp kSaidAgain = std::chrono::minutes(1);

}  // namespace

std::optional<FixOutcome> FixQueue::add(const RawFix& fix) {
  SaneFix sane = sanity_.add(fix);
  auto rejected = reject_without_datum(fix, raw_.empty() ? last_stamp_ : raw_.back().fix.stamp);
  if (!rejected) push_bounded(raw_, std::move(sane));
  return rejected;
}

std::vector<FixOutcome> FixQueue::validate(const LocalFrame& frame) {
  std::vector<FixOutcome> rejected;
  for (const SaneFix& raw : std::exchange(raw_, {})) {
    ValidatedFix fix = validate_fix(raw.fix, frame, last_stamp_, parameters_);
    FixOutcome& outcome = fix.outcome;
    if (is_rejected(outcome.decision)) {
      sanity_.note_far(hint_of_far_place(raw.fix.position, frame, parameters_.max_distance_from_datum));
      rejected.push_back(std::move(outcome));
      continue;
    }
    sanity_.note_far({});
    if (outcome.covariance_clamped) note_clamped(outcome);
    if (!raw.reason.empty()) {
      if (outcome.decision == FixDecision::kAccepted) outcome.decision = FixDecision::kInflated;
      outcome.covariance_clamped = true;
      outcome.reason = raw.reason + (outcome.reason.empty() ? "" : "; ") + outcome.reason;
    }
    last_stamp_ = raw.fix.stamp;
    push_bounded(validated_, std::move(fix));
  }
  return rejected;
}

ValidatedFix FixQueue::pop() {
  ValidatedFix fix = std::move(validated_.front());
  validated_.pop_front();
  return fix;
}

void FixQueue::note_clamped(const FixOutcome& outcome) {
  ++clamped_;
  const bool is_due = !said_clamped_ || outcome.stamp < *said_clamped_ || outcome.stamp - *said_clamped_ >= kSaidAgain;
  if (!is_due) return;
  events_.push_back({PipelineEvent::Level::kWarn, "the covariance of " + std::to_string(clamped_) +
                                                      (clamped_ == 1 ? " fix" : " fixes") +
                                                      " was not used as declared: " + outcome.reason});
  said_clamped_ = outcome.stamp;
  clamped_ = 0;
}

std::vector<PipelineEvent> FixQueue::take_events() {
  using Level = PipelineEvent::Level;
  std::vector<PipelineEvent> events = std::exchange(events_, {});
  for (FixSanity::News& news : sanity_.take_news()) {
    events.push_back({news.is_warning ? Level::kWarn : Level::kInfo, std::move(news.text)});
  }
  return events;
}

void FixQueue::reset() {
  raw_.clear();
  validated_.clear();
  last_stamp_.reset();
}

}  // namespace urban_gnss
