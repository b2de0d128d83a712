#pragma once

#include <optional>

#include "urban_gnss_localization/common/stamp.hpp"

namespace urban_gnss {

/// Watches the stamps of one stream of messages, so that a clock that jumps back (a bag that starts over) is told apart
/// from a message that comes late or twice.
class StampMonitor {
 public:
  /// `jump_s` > 0: going back by more than this is a jump.
  explicit StampMonitor(double jump_s) : jump_(from_seconds(jump_s)) {}

  /// Whether a message with this stamp is to be used: one that is newer than the last is, one that is late or comes
  /// twice is not. Where the clock was set back, `on_jump` is told by how much and says whether to follow it.
  template <class OnJump>
  bool accept(Stamp stamp, const OnJump& on_jump) {
    if (last_ && stamp <= *last_) {
      const Stamp back = *last_ - stamp;
      if (back <= jump_ || !on_jump(back)) return false;
    }
    last_ = stamp;
    return true;
  }

  void reset() { last_.reset(); }

 private:
  Stamp jump_;
  std::optional<Stamp> last_;
};

}  // namespace urban_gnss
