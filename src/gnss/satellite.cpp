#include "urban_gnss_localization/gnss/satellite.hpp"

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

std::string satellite_name(const SatelliteId& id) {
  const std::string number = std::to_string(id.svid);
  return rinex_letter(id.constellation) + (number.size() < 2 ? "0" + number : number);
}

}  // namespace urban_gnss
