#pragma once

#include <cstddef>
#include <optional>
#include <string>

#include "urban_gnss_localization/common/stamp.hpp"

namespace urban_gnss {

/// What a stamp is within its stream.
enum class StampVerdict {
  kNew,        ///< newer than the last: to be used
  kNotNewer,   ///< late, or come twice
  kOdd,        ///< far from the stream: not to be used unless the stream goes on from there
  kWentBack,   ///< the stream goes on in the past: its clock was set back, and this stamp is the newest now
  kWentAhead,  ///< the stream goes on in the future, likewise
};

/// Watches the stamps of one stream of messages. A clock that was set back (a bag that starts over) or ahead is told
/// apart from a message that is late, comes twice or has a wrong stamp: one odd stamp is no clock, several that go on
/// from one another are.
class StampMonitor {
 public:
  /// Odd stamps that go on from one another, with which their clock counts as set.
  static constexpr std::size_t kConfirm = 3;

  /// `jump_s` > 0: farther back, or ahead, than this may be odd.
  explicit StampMonitor(double jump_s) : jump_(from_seconds(jump_s)) {}

  /// A stamp that is ahead is odd where the step is five times as long as the one before. `reference` is the time by
  /// another stream; where that goes on, a stamp is odd if it is farther ahead of it, by more than a step, than the one
  /// before was: a stream may pause.
  StampVerdict judge(Stamp stamp, std::optional<Stamp> reference = std::nullopt);
  /// The newest that is used.
  const std::optional<Stamp>& last() const { return last_; }
  /// Odd ones in a row, up to now.
  std::size_t run() const { return run_; }
  /// Of them, those that lie in the past.
  std::size_t back_in_a_row() const { return is_run_back_ ? run_ : 0; }

  void reset();

 private:
  bool is_odd_ahead(Stamp stamp, std::optional<Stamp> reference) const;
  StampVerdict add_odd(Stamp stamp, bool is_back, std::optional<Stamp> reference);
  void take(Stamp stamp, std::optional<Stamp> reference);

  Stamp jump_;
  std::optional<Stamp> last_;
  std::optional<Stamp> step_;  ///< from the one before to the last
  std::optional<Stamp> last_reference_;
  std::size_t run_{0};
  bool is_run_back_{false};
  Stamp run_last_{0};
};

/// "3.2 s behind" or "ahead of"; of a stamp that is odd, for people.
std::string describe_oddness(Stamp stamp, Stamp last);

}  // namespace urban_gnss
