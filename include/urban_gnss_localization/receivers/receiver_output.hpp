#pragma once

#include <string>
#include <vector>

#include "urban_gnss_localization/gnss/fix.hpp"
#include "urban_gnss_localization/gnss/satellite_epoch.hpp"

namespace urban_gnss {

/// What a decoder found since it was asked last. Fix, velocity and satellites of one solution have one stamp; each list
/// is in the order in which solutions were completed.
struct ReceiverOutput {
  std::vector<RawFix> fixes;
  std::vector<RawVelocity> velocities;
  std::vector<SatelliteEpoch> satellites;
  std::vector<std::string> warnings;  ///< for people: each names the message, the field and what was done about it

  bool empty() const { return fixes.empty() && velocities.empty() && satellites.empty() && warnings.empty(); }
};

}  // namespace urban_gnss
