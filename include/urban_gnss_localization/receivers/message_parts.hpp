#pragma once

#include "urban_gnss_localization/gnss/fix.hpp"
#include "urban_gnss_localization/gnss/satellite.hpp"
#include "urban_gnss_localization/receivers/message_view.hpp"

/// What the messages of several drivers have in common.
namespace urban_gnss {

/// Of sensor_msgs/NavSatFix. A variance of -1 in the first place means that there is no covariance.
RawFix navsat_fix_of(const MessageView& message, Stamp stamp);

/// Of geometry_msgs/TwistWithCovarianceStamped or TwistStamped: x is east, y is north.
RawVelocity velocity_of(const MessageView& message, Stamp stamp);

/// By whole numbers, as messages have it.
CovarianceType covariance_type_of(std::int64_t value);

/// Unknown (not finite) where the elevation is beyond 90 degrees either way, which is how drivers say so. The azimuth
/// may be of any turn.
LookAngles look_angles(double azimuth_deg, double elevation_deg);

/// dB-Hz; unknown where it is 0 or less.
double cn0_or_unknown(double cn0_dbhz);

/// Step of whole degrees, rad.
double whole_degrees_rad();

}  // namespace urban_gnss
