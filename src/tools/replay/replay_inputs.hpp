#pragma once

#include <rosbag/bag.h>

#include <functional>
#include <optional>
#include <vector>

#include "receiver_recording.hpp"
#include "replay_run.hpp"
#include "replay_settings.hpp"
#include "urban_gnss_localization/common/stamp.hpp"

namespace urban_gnss {

/// One message, or what else a run takes.
struct ReplayInput {
  Stamp time{0};  ///< when it was recorded
  std::function<void(ReplayRun&)> give_to;
  bool is_latched{false};  ///< counts from whenever the run begins
};

/// All that a run takes, in the order in which it takes it. Keeps its bag open.
class ReplayInputs {
 public:
  /// Throws std::runtime_error where a file cannot be read, or where a topic that is needed has no message; it then
  /// lists what the bag has.
  explicit ReplayInputs(const ReplayOptions& options);

  const std::vector<ReplayInput>& all() const { return inputs_; }
  /// From the first input to the last, s.
  double duration_s() const;
  /// Whether the bag's tf has a transform from this frame to another.
  bool has_transforms_from(const std::string& frame) const;
  /// What a receiver said, where it takes the place of topics.
  const std::optional<ReceiverRecording>& receiver() const { return receiver_; }

 private:
  void read_receiver(const ReplayOptions& options);
  void read_topics(const ReplayOptions& options);
  void read_odometry_of_receiver();
  void require_overlap() const;
  /// Leaves the part that was asked for.
  void cut_out(const ReplayOptions& options);

  rosbag::Bag bag_;
  std::optional<ReceiverRecording> receiver_;
  std::vector<ReplayInput> inputs_;
};

}  // namespace urban_gnss
