#include "urban_gnss_localization/gnss/position_hint.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>

namespace urban_gnss {
namespace {

bool is_place(double latitude, double longitude) { return is_latitude(latitude) && is_longitude(longitude); }

std::string guess(const std::string& mistake, double latitude, double longitude) {
  std::ostringstream out;
  out.precision(9);
  out << mistake << latitude << ", " << longitude;
  return out.str();
}

/// ddmm.mmmm as degrees; NaN where it is none.
double from_degrees_and_minutes(double value) {
  const double degrees = std::trunc(value / 100.0);
  const double minutes = value - 100.0 * degrees;
  return std::abs(minutes) < 60.0 ? degrees + minutes / 60.0 : std::nan("");
}

}  // namespace

std::string hint_of_no_place(const GeodeticPosition& position) {
  const double latitude = position.latitude_deg;
  const double longitude = position.longitude_deg;
  if (!std::isfinite(latitude) || !std::isfinite(longitude) || is_place(latitude, longitude)) return {};
  if (is_place(longitude, latitude)) return guess("latitude and longitude swapped, of ", longitude, latitude) + "?";
  if (is_latitude(latitude) && longitude > 180.0 && longitude <= 360.0) {
    return guess("a longitude from 0 to 360, of ", latitude, longitude - 360.0) + "?";
  }
  std::string hint;
  const auto add = [&](const std::string& mistake, double as_latitude, double as_longitude) {
    // About (0, 0) nothing drives: rather another of the mistakes.
    if (!is_place(as_latitude, as_longitude) || std::max(std::abs(as_latitude), std::abs(as_longitude)) < 1.0) return;
    hint += (hint.empty() ? "" : ", or ") + guess(mistake, as_latitude, as_longitude);
  };
  for (const auto& [name, factor] : {std::pair{"1e7", 1e7}, std::pair{"1e6", 1e6}, std::pair{"1e3", 1e3}}) {
    add("degrees times " + std::string(name) + " of ", latitude / factor, longitude / factor);
  }
  add("NMEA's degrees and minutes (ddmm.mmmm) of ", from_degrees_and_minutes(latitude),
      from_degrees_and_minutes(longitude));
  return hint.empty() ? hint : hint + "?";
}

std::string hint_of_far_place(const GeodeticPosition& position, const LocalFrame& frame, double max_distance_m) {
  const double latitude = position.latitude_deg;
  const double longitude = position.longitude_deg;
  const auto is_near = [&](double as_latitude, double as_longitude) {
    return is_place(as_latitude, as_longitude) &&
           frame.to_local({as_latitude, as_longitude, frame.datum().altitude_m}).norm() <= max_distance_m;
  };
  if (is_near(longitude, latitude)) return "latitude and longitude swapped?";
  if (is_near(latitude, -longitude)) return "the sign of the longitude (east is positive)?";
  if (is_near(-latitude, longitude)) return "the sign of the latitude (north is positive)?";
  if (is_near(-latitude, -longitude)) return "the signs of latitude and longitude?";
  return {};
}

std::string why_too_far(const GeodeticPosition& position, const LocalFrame& frame, double max_distance_m,
                        const std::string& origin) {
  // At the datum's height, so that a height above another reference than the ellipsoid does not count; and through the
  // Earth, because the horizontal distance shrinks again towards the antipode.
  const double distance_m =
      frame.to_local({position.latitude_deg, position.longitude_deg, frame.datum().altitude_m}).norm();
  if (distance_m <= max_distance_m) return {};
  std::ostringstream text;
  text << distance_m << " m from the " << origin << ", farther than " << max_distance_m << " m";
  const std::string hint = hint_of_far_place(position, frame, max_distance_m);
  if (!hint.empty()) text << ": " << hint;
  return text.str();
}

bool looks_like_radians(const GeodeticPosition& position) {
  constexpr double kHalfTurn = 3.15;
  constexpr double kSimulated_deg = 0.1;
  const double latitude = std::abs(position.latitude_deg);
  const double longitude = std::abs(position.longitude_deg);
  return latitude <= 0.5 * kHalfTurn && longitude <= kHalfTurn && std::max(latitude, longitude) > kSimulated_deg;
}

}  // namespace urban_gnss
