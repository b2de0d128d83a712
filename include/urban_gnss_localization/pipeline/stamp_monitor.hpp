#pragma once

#include <optional>
#include <string>

#include "urban_gnss_localization/common/stamp.hpp"

namespace urban_gnss {

/// Watches the stamps of one stream of messages, so that a clock that jumps back (a bag that starts over) is told apart
/// from a message that comes late or twice.
class StampMonitor {
 public:
  enum class Order { kNewer, kNotNewer, kJumpedBack };

  /// `jump_s` > 0: going back by more than this is a jump.
  explicit StampMonitor(double jump_s) : jump_(from_seconds(jump_s)) {}

  /// Judges a stamp; only a newer one is remembered.
  Order observe(Stamp stamp) {
    if (last_ && stamp < *last_ - jump_) return Order::kJumpedBack;
    if (last_ && stamp <= *last_) return Order::kNotNewer;
    last_ = stamp;
    return Order::kNewer;
  }

  std::optional<Stamp> last() const { return last_; }
  void reset() { last_.reset(); }

 private:
  Stamp jump_;
  std::optional<Stamp> last_;
};

/// Something that happened and that people should hear of once.
struct PipelineEvent {
  enum class Level { kInfo, kWarn, kError };
  Level level{Level::kInfo};
  std::string text;
};

}  // namespace urban_gnss
