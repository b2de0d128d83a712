#include "urban_gnss_localization/pipeline/fix_queue.hpp"

#include <utility>

#include "limits.hpp"

namespace urban_gnss {

void FixQueue::add(const RawFix& fix) { push_bounded(raw_, fix); }

std::vector<FixOutcome> FixQueue::validate(const LocalFrame& frame) {
  std::vector<FixOutcome> rejected;
  for (const RawFix& raw : std::exchange(raw_, {})) {
    ValidatedFix fix = validate_fix(raw, frame, last_stamp_, parameters_);
    if (is_rejected(fix.outcome.decision)) {
      rejected.push_back(std::move(fix.outcome));
      continue;
    }
    last_stamp_ = raw.stamp;
    push_bounded(validated_, std::move(fix));
  }
  return rejected;
}

ValidatedFix FixQueue::pop() {
  ValidatedFix fix = std::move(validated_.front());
  validated_.pop_front();
  return fix;
}

}  // namespace urban_gnss
