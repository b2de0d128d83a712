#pragma once

#include <optional>
#include <string>

#include "urban_gnss_localization/gnss/fix.hpp"
#include "urban_gnss_localization/gnss/satellite_epoch.hpp"
#include "urban_gnss_localization/receivers/message_view.hpp"

/// gps_common/GPSFix and GPSStatus (gps_msgs/…, too). http://wiki.ros.org/gps_common
namespace urban_gnss {

/// The fix. Its covariance, where the message declares one; else of err_horz (or err) and err_vert, which are the
/// bounds of 95 %: per axis 1/2.448 of the radius of a circle, 1/1.96 up.
RawFix gps_fix_of(const MessageView& message, Stamp stamp);

/// Speed and track (degrees from north) as velocity (ground_velocity()), err_speed and err_track (95 %) as its
/// covariance. Nothing where the driver left them out: all 0, not finite, or at speed with a track that is none.
std::optional<RawVelocity> gps_fix_velocity_of(const MessageView& message, Stamp stamp);

/// The satellites that the driver lists as visible, by its way of numbering; empty where it lists none. `prefix` is
/// "status." in a GPSFix, "" in a GPSStatus. Lists may be of different lengths: what is missing is unknown. Whether a
/// satellite is used is not read, as drivers get it wrong. 0 degrees both ways is how drivers say unknown.
SatelliteEpoch gps_status_satellites_of(const MessageView& message, const std::string& prefix,
                                        std::optional<SatelliteId> (*satellite_of)(int number));

}  // namespace urban_gnss
