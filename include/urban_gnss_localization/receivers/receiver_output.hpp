#pragma once

#include <string>
#include <vector>

#include "urban_gnss_localization/common/stamp.hpp"
#include "urban_gnss_localization/gnss/fix.hpp"
#include "urban_gnss_localization/gnss/satellite.hpp"

namespace urban_gnss {

/// Every satellite that a receiver reports for one solution, as in SatelliteArray.msg.
struct SatelliteEpoch {
  Stamp stamp{0};                    ///< that of the fix they belong to
  double angle_resolution_rad{0.0};  ///< step to which azimuth and elevation are rounded; 0 where unknown
  std::vector<SatelliteObservation> satellites;
};

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
