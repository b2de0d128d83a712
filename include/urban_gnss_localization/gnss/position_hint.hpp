#pragma once

#include <string>

#include "urban_gnss_localization/geometry/local_frame.hpp"

namespace urban_gnss {

/// What a latitude and longitude that are no place may have been meant as: in a known mistake of a driver, or of a
/// script that writes bags. For people, e.g. "degrees times 1e7 of 48.1374, 11.5755?"; empty where no mistake explains
/// them. Knows degrees times 1e3, 1e6 and 1e7 (MAVLink and u-blox count in the last), NMEA's degrees and minutes
/// (ddmm.mmmm), latitude and longitude swapped, and longitudes from 0 to 360 (ixblue_ins_stdbin_driver#12).
std::string hint_of_no_place(const GeodeticPosition& position);

/// The same of a place that is farther than `max_distance_m` from the datum: swapped, or with a hemisphere's sign lost,
/// it is within it.
std::string hint_of_far_place(const GeodeticPosition& position, const LocalFrame& frame, double max_distance_m);

/// "2e+05 m from the datum, farther than 1e+05 m", with the hint above; empty where it is within the distance. `origin`
/// is what the frame's datum is, for people. Heights do not count.
std::string why_too_far(const GeodeticPosition& position, const LocalFrame& frame, double max_distance_m,
                        const std::string& origin);

/// Whether a place is likely to be one in radians: there is no land within 1.58 degrees of the equator and 3.15 of
/// Greenwich. Simulated worlds about (0, 0) are not meant.
bool looks_like_radians(const GeodeticPosition& position);

}  // namespace urban_gnss
