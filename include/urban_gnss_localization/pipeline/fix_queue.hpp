#pragma once

#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "urban_gnss_localization/gnss/fix_sanity.hpp"
#include "urban_gnss_localization/gnss/fix_validation.hpp"
#include "urban_gnss_localization/pipeline/pipeline_event.hpp"

namespace urban_gnss {

/// Fixes that wait, in the order in which they came: as the receiver reports them until there is a datum, then
/// validated until what belongs to them is there. Of too many that wait, the oldest are dropped. Known mistakes of
/// drivers are found on the way (FixSanity).
class FixQueue {
 public:
  /// Requires parameters without faults.
  explicit FixQueue(const FixValidationParameters& parameters) : parameters_(parameters), sanity_(parameters) {}

  /// Returns what was decided of the fix where it cannot be used wherever the datum is; it does not wait then.
  std::optional<FixOutcome> add(const RawFix& fix);
  /// Validates those that waited for the datum. Returns what was decided of those that are rejected, which wait no
  /// more.
  std::vector<FixOutcome> validate(const LocalFrame& frame);

  /// The oldest of the validated fixes; null where there is none.
  const ValidatedFix* next() const { return validated_.empty() ? nullptr : &validated_.front(); }
  /// Takes it out. Requires that there is one.
  ValidatedFix pop();

  /// Of the fix that was validated last; nothing before the first.
  const std::optional<Stamp>& last_stamp() const { return last_stamp_; }

  /// Mistakes of the driver, each once, also across reset(). And once a minute at the most, by the stamps, that
  /// covariances were replaced or clamped.
  std::vector<PipelineEvent> take_events();
  /// What is wrong with the covariance of the last fixes, for people; empty where nothing is.
  std::string complaint() const { return sanity_.complaint(); }

  /// Forgets the fixes.
  void reset();

 private:
  /// The covariance of a fix is not what its receiver declares.
  void note_clamped(const FixOutcome& outcome);

  FixValidationParameters parameters_;
  FixSanity sanity_;
  std::deque<SaneFix> raw_;
  std::deque<ValidatedFix> validated_;
  std::optional<Stamp> last_stamp_;
  std::optional<Stamp> said_clamped_;
  std::size_t clamped_{0};  ///< since it was said
  std::vector<PipelineEvent> events_;
};

}  // namespace urban_gnss
