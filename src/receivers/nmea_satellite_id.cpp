#include "urban_gnss_localization/receivers/nmea_satellite_id.hpp"

#include "satellite_number_range.hpp"

namespace urban_gnss {
namespace {

/// In sentences of any system, or of a system that is not known.
constexpr SatelliteNumberRange kShared[] = {
    {Constellation::kGps, 1, 32, 1},       {Constellation::kSbas, 33, 64, 120},
    {Constellation::kGlonass, 65, 99, 1},  {Constellation::kSbas, 120, 158, 120},
    {Constellation::kImes, 173, 182, 1},   {Constellation::kQzss, 193, 200, 1},
    {Constellation::kBeidou, 201, 263, 1}, {Constellation::kGalileo, 301, 336, 1},
    {Constellation::kBeidou, 401, 463, 1}, {Constellation::kNavic, 500, 514, 1},
};

/// In sentences of the system itself, before the shared ones.
constexpr SatelliteNumberRange kOwn[] = {
    {Constellation::kGlonass, 1, 32, 1}, {Constellation::kGalileo, 1, 36, 1}, {Constellation::kBeidou, 1, 63, 1},
    {Constellation::kQzss, 1, 10, 1},    {Constellation::kQzss, 193, 202, 1}, {Constellation::kNavic, 1, 15, 1},
};

}  // namespace

Constellation nmea_system(std::string_view talker, std::string_view system_id) {
  if (system_id == "1") return Constellation::kGps;
  if (system_id == "2") return Constellation::kGlonass;
  if (system_id == "3") return Constellation::kGalileo;
  if (system_id == "4") return Constellation::kBeidou;
  if (system_id == "5") return Constellation::kQzss;
  if (system_id == "6") return Constellation::kNavic;
  if (talker == "GP") return Constellation::kGps;
  if (talker == "GL") return Constellation::kGlonass;
  if (talker == "GA") return Constellation::kGalileo;
  if (talker == "GB" || talker == "BD" || talker == "PQ") return Constellation::kBeidou;
  if (talker == "GQ" || talker == "QZ") return Constellation::kQzss;
  if (talker == "GI") return Constellation::kNavic;
  return Constellation::kUnknown;
}

std::optional<SatelliteId> nmea_satellite_id(Constellation system, int number) {
  for (const SatelliteNumberRange& range : kOwn) {
    if (range.constellation != system) continue;
    if (const auto id = range.id_of(number)) return id;
  }
  return id_in(kShared, number);
}

}  // namespace urban_gnss
