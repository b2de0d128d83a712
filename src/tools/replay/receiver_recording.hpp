#pragma once

#include <string>
#include <vector>

#include "urban_gnss_localization/common/stamp.hpp"
#include "urban_gnss_localization/receivers/receiver_output.hpp"

namespace urban_gnss {

/// What a receiver said at one time.
struct TimedOutput {
  Stamp time{0};  ///< when it was known, by the clock of the bag that it is merged with
  ReceiverOutput output;
};

/// All that a receiver said in one recording, whatever it was read from. It takes the place of the topics of fix,
/// velocity and satellites.
struct ReceiverRecording {
  std::string source;  ///< for people: what was read
  std::vector<TimedOutput> outputs;
};

}  // namespace urban_gnss
