#pragma once

#include <deque>
#include <optional>
#include <vector>

#include "urban_gnss_localization/gnss/fix_validation.hpp"

namespace urban_gnss {

/// Fixes that wait, in the order in which they came: as the receiver reports them until there is a datum, then
/// validated until what belongs to them is there. Of too many that wait, the oldest are dropped.
class FixQueue {
 public:
  /// Requires parameters without faults.
  explicit FixQueue(const FixValidationParameters& parameters) : parameters_(parameters) {}

  void add(const RawFix& fix);
  /// Validates those that waited for the datum. Returns what was decided of those that are rejected, which wait no
  /// more.
  std::vector<FixOutcome> validate(const LocalFrame& frame);

  /// The oldest of the validated fixes; null where there is none.
  const ValidatedFix* next() const { return validated_.empty() ? nullptr : &validated_.front(); }
  /// Takes it out. Requires that there is one.
  ValidatedFix pop();

  /// Of the fix that was validated last; nothing before the first.
  const std::optional<Stamp>& last_stamp() const { return last_stamp_; }

  void reset() { *this = FixQueue(parameters_); }

 private:
  FixValidationParameters parameters_;
  std::deque<RawFix> raw_;
  std::deque<ValidatedFix> validated_;
  std::optional<Stamp> last_stamp_;
};

}  // namespace urban_gnss
