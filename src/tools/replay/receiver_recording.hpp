#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "urban_gnss_localization/common/stamp.hpp"
#include "urban_gnss_localization/motion/odometry_history.hpp"
#include "urban_gnss_localization/receivers/receiver_input.hpp"

namespace urban_gnss {

/// What a receiver said at one time.
struct TimedOutput {
  Stamp time{0};  ///< when it was known, by the clock of the bag that it is merged with
  ReceiverOutput output;
};

/// All that a receiver said in one recording, whatever it was read from. It takes the place of the topics of fix,
/// velocity and satellites.
struct ReceiverRecording {
  std::string source;         ///< for people: what was read
  std::string antenna_frame;  ///< that the driver's messages name; empty: none
  std::vector<TimedOutput> outputs;
  ReceiverCounts counts;
  std::size_t unreadable{0};  ///< messages that were left out
};

/// Odometry for a run without wheels (`--odom none`), of the receiver's velocities, or of its fixes where it has none.
/// Each sample comes at the time of the first output with a stamp that is not older.
struct TimedOdometry {
  Stamp time{0};
  OdometrySample sample;
};
std::vector<TimedOdometry> odometry_of(const ReceiverRecording& recording);

}  // namespace urban_gnss
