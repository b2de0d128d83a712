#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "urban_gnss_localization/receivers/receiver_presets.hpp"

namespace urban_gnss {

/// Nothing that is no number goes on. A fix without a finite place is none; an altitude, an angle, a C/N0 or a residual
/// that is not finite is unknown; a covariance that is none (covariance_fault()) is not declared; a velocity that is not
/// finite is left out.
void make_sound(ReceiverOutput& output);

/// What came of a receiver's messages.
struct ReceiverCounts {
  std::size_t fixes{0};     ///< with a position
  std::size_t no_fixes{0};  ///< the receiver says that it has no fix
  std::size_t velocities{0};
  std::size_t epochs{0};  ///< lists of satellites, one for each stamp
  std::size_t fixes_with_satellites{0};
  std::size_t fixes_with_residuals{0};
};

/// Counts what decoders give.
class ReceiverCounter {
 public:
  void add(const ReceiverOutput& output);
  const ReceiverCounts& counts() const { return counts_; }

 private:
  struct Solution {
    Stamp stamp;
    bool has_fix{false}, has_epoch{false}, has_satellites{false}, has_residuals{false};
  };
  Solution& at(Stamp stamp);
  void update(Solution& solution, const Solution& before);

  ReceiverCounts counts_;
  std::deque<Solution> recent_;
};

/// What comes with a message and tells how to read it.
struct MessageConnection {
  std::string topic;
  std::string type;  ///< package/Type
  std::string md5;
  std::string definition;
};

/// The messages of one receiver in, fixes, velocities and satellites out, the same live and offline. A message that
/// cannot be read is left out and counted; the reason, with topic, type, md5 and field, is said once.
class ReceiverInput {
 public:
  /// Requires a preset with a decoder.
  explicit ReceiverInput(const ReceiverPreset& preset);

  /// `arrival`: when the message was received or recorded; where it goes back by more than a second, everything begins
  /// anew. Looks at the definition only with the first message of a connection.
  void add(const ReceiverTopic& topic, const MessageConnection& connection, const std::uint8_t* data, std::size_t size,
           Stamp arrival);
  void finish();
  /// All finite.
  ReceiverOutput take();

  const ReceiverCounts& counts() const { return counter_.counts(); }
  /// Messages, by topic.
  const std::map<std::string, std::size_t>& received() const { return received_; }
  const std::map<std::string, std::size_t>& unreadable() const { return unreadable_; }
  /// The last error; empty where there was none.
  const std::string& last_error() const { return last_error_; }
  /// The antenna's, of the newest fix whose header names one; velocities may be in another.
  const std::string& frame_id() const { return frame_id_; }

 private:
  const MessageDefinition& definition_of(const MessageConnection& connection);
  void note_error(const MessageConnection& connection, const std::string& error);

  const ReceiverPreset* preset_;
  std::unique_ptr<ReceiverDecoder> decoder_;
  Stamp last_arrival_{0};
  std::map<std::string, std::unique_ptr<MessageDefinition>> definitions_;  ///< by topic, type and md5
  ReceiverCounter counter_;
  std::map<std::string, std::size_t> received_;
  std::map<std::string, std::size_t> unreadable_;
  std::set<std::string> said_;
  std::vector<std::string> warnings_;
  std::string last_error_;
  std::string frame_id_;
};

}  // namespace urban_gnss
