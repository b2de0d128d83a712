#include "urban_gnss_localization/receivers/satellite_numbers.hpp"

#include "satellite_number_range.hpp"
#include "urban_gnss_localization/receivers/nmea_satellite_id.hpp"

namespace urban_gnss {
namespace {

constexpr SatelliteNumberRange kUbloxSvinfo[] = {
    {Constellation::kGps, 1, 32, 1},       {Constellation::kBeidou, 33, 64, 6},    {Constellation::kGlonass, 65, 96, 1},
    {Constellation::kSbas, 120, 158, 120}, {Constellation::kBeidou, 159, 163, 1},  {Constellation::kImes, 173, 182, 1},
    {Constellation::kQzss, 193, 202, 1},   {Constellation::kGalileo, 211, 246, 1},
};
constexpr SatelliteNumberRange kSeptentrio[] = {
    {Constellation::kGps, 1, 37, 1},        {Constellation::kGlonass, 38, 61, 1},
    {Constellation::kGlonass, 63, 68, 25},  {Constellation::kGalileo, 71, 106, 1},
    {Constellation::kSbas, 120, 140, 120},  {Constellation::kBeidou, 141, 180, 1},
    {Constellation::kQzss, 181, 190, 1},    {Constellation::kNavic, 191, 197, 1},
    {Constellation::kSbas, 198, 215, 141},  {Constellation::kNavic, 216, 222, 8},
    {Constellation::kBeidou, 223, 245, 41},
};
/// Of a channel whose status says GPS, which is also that of a channel without a status.
constexpr SatelliteNumberRange kNovatelByNumber[] = {
    {Constellation::kGps, 1, 32, 1},
    {Constellation::kGlonass, 38, 61, 1},
    {Constellation::kSbas, 120, 158, 120},
    {Constellation::kQzss, 193, 202, 1},
};
constexpr SatelliteNumberRange kNovatelBySystem[] = {
    {Constellation::kGlonass, 38, 68, 1}, {Constellation::kSbas, 120, 158, 120}, {Constellation::kGalileo, 1, 36, 1},
    {Constellation::kBeidou, 1, 63, 1},   {Constellation::kQzss, 193, 202, 1},   {Constellation::kNavic, 1, 14, 1},
};

}  // namespace

std::optional<SatelliteId> satellite_of_gpsd(int number) { return nmea_satellite_id(Constellation::kUnknown, number); }

std::optional<SatelliteId> satellite_of_ublox_svinfo(int number) { return id_in(kUbloxSvinfo, number); }

std::optional<SatelliteId> satellite_of_septentrio(int number) { return id_in(kSeptentrio, number); }

std::optional<SatelliteId> satellite_of_novatel(int prn, std::uint32_t tracking_status) {
  constexpr std::uint32_t kSystems = sizeof(kNovatelBySystem) / sizeof(SatelliteNumberRange);
  const std::uint32_t system = (tracking_status >> 16U) & 7U;  // 0 GPS, then as in kNovatelBySystem
  if (system == 0) return id_in(kNovatelByNumber, prn);
  return system <= kSystems ? kNovatelBySystem[system - 1].id_of(prn) : std::nullopt;
}

}  // namespace urban_gnss
