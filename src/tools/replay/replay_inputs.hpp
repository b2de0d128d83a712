#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "bag_receiver.hpp"
#include "files/bag_reader.hpp"
#include "receiver_recording.hpp"
#include "replay_run.hpp"
#include "replay_settings.hpp"
#include "urban_gnss_localization/common/stamp.hpp"

namespace urban_gnss {

/// The topics that are read, without their leading slashes.
struct ReplayTopics {
  explicit ReplayTopics(const ReplayOptions& options);

  std::string fix, odom, imu, velocity, satellites, points, truth;
};

/// All that a run takes, one after the other, in the order in which it takes it. Messages are read when their turn
/// comes, so that a long bag takes no more memory than a short one.
class ReplayInputs {
 public:
  /// Throws std::runtime_error where a file cannot be read, or where a topic that is needed has no message; it then
  /// lists what the bag has.
  explicit ReplayInputs(const ReplayOptions& options);

  /// How many there are at most.
  std::size_t size() const;
  /// Gives the next to the run; false at the end. Throws std::runtime_error where the bag is damaged, or where nothing
  /// comes after --start.
  bool give_next(ReplayRun& run);
  /// From the first that was given to the last, s.
  double duration_s() const { return to_seconds(last_ - begin_); }
  /// What a receiver said, where it takes the place of topics, without its outputs. To be asked at the end.
  std::optional<ReceiverRecording> receiver() const;
  /// Messages in the bag.
  std::size_t truths() const { return bag_ ? bag_->count(topics_.truth) : 0; }
  std::size_t odometries() const { return bag_ ? bag_->count(topics_.odom) : 0; }
  /// Whether the bag's tf has a transform from this frame to another.
  bool has_transforms_from(const std::string& frame) const;

 private:
  /// What comes from elsewhere than from the bag's topics.
  struct Input {
    Stamp time{0};  ///< when it was recorded
    std::function<void(ReplayRun&)> give_to;
  };

  void read_receiver();
  void say_what_is_left_out() const;
  void read_topics();
  void require_topics() const;
  void require_clouds() const;
  void require_overlap() const;
  bool comes_from_bag();
  void give(const BagMessage& message, ReplayRun& run);
  /// Whether it lies in the part that was asked for.
  bool is_wanted(Stamp time, bool is_latched);

  ReplayOptions options_;
  ReplayTopics topics_;
  std::optional<BagReader> bag_;
  std::optional<BagMessages> messages_;
  std::optional<BagReceiver> driver_;           ///< decoded as its messages come
  std::optional<ReceiverRecording> recording_;  ///< read before all else
  std::vector<Input> others_;
  std::size_t next_other_{0};
  std::optional<Stamp> first_;  ///< of all, before what was asked for is cut out
  Stamp begin_{0};
  Stamp last_{0};
  bool has_begun_{false};
  bool has_ended_{false};
};

}  // namespace urban_gnss
