#include "urban_gnss_localization/gnss/satellite.hpp"

#include "urban_gnss_localization/geometry/angles.hpp"

namespace urban_gnss {
namespace {

char rinex_letter(Constellation constellation) {
  switch (constellation) {
    case Constellation::kGps: return 'G';
    case Constellation::kSbas: return 'S';
    case Constellation::kGalileo: return 'E';
    case Constellation::kBeidou: return 'C';
    case Constellation::kQzss: return 'J';
    case Constellation::kGlonass: return 'R';
    case Constellation::kNavic: return 'I';
    case Constellation::kImes:  // indoor transmitters, which RINEX does not know
    case Constellation::kUnknown: break;
  }
  return '?';
}

}  // namespace

Constellation clock_of(Constellation constellation) {
  const bool keeps_gps_time = constellation == Constellation::kSbas || constellation == Constellation::kQzss;
  return keeps_gps_time ? Constellation::kGps : constellation;
}

bool has_direction(const SatelliteObservation& satellite) {
  constexpr double kRounding_rad = 1e-6;  // of receivers that give the zenith in single precision
  const LookAngles& look = satellite.look;
  return std::isfinite(look.azimuth_rad) && look.elevation_rad >= 0.0 &&
         look.elevation_rad <= 0.5 * kPi + kRounding_rad;
}

bool has_cn0(const SatelliteObservation& satellite) {
  return std::isfinite(satellite.cn0_dbhz) && satellite.cn0_dbhz > 0.0;
}

bool is_received(const SatelliteObservation& satellite) {
  return satellite.tracked && has_direction(satellite) && has_cn0(satellite);
}

double residual_rms_m(const std::vector<SatelliteObservation>& satellites) {
  double squares = 0.0;
  int count = 0;
  for (const SatelliteObservation& each : satellites) {
    if (!is_received(each) || !std::isfinite(each.residual_m)) continue;
    squares += each.residual_m * each.residual_m;
    ++count;
  }
  return count > 0 ? std::sqrt(squares / count) : 0.0;
}

std::string satellite_name(const SatelliteId& id) {
  const std::string number = std::to_string(id.svid);
  return rinex_letter(id.constellation) + (number.size() < 2 ? "0" + number : number);
}

}  // namespace urban_gnss
