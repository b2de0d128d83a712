#pragma once

#include <vector>

#include "urban_gnss_localization/common/stamp.hpp"
#include "urban_gnss_localization/gnss/satellite.hpp"

namespace urban_gnss {

/// Every satellite that a receiver reports for one solution, as in SatelliteArray.msg.
struct SatelliteEpoch {
  Stamp stamp{0};  ///< that of the fix they belong to
  std::vector<SatelliteObservation> satellites;
  double angle_resolution_rad{0.0};  ///< step to which the receiver rounds azimuth and elevation; 0: unknown
};

}  // namespace urban_gnss
