#include "urban_gnss_localization/receivers/nmea_sky.hpp"

#include <algorithm>
#include <cmath>

#include "urban_gnss_localization/geometry/angles.hpp"
#include "urban_gnss_localization/receivers/nmea_fields.hpp"
#include "urban_gnss_localization/receivers/nmea_satellite_id.hpp"

namespace urban_gnss {
namespace {

constexpr double kMostCn0_dbhz = 99.0;        // two digits in the standard
constexpr double kMostResidual_m = 100000.0;  // no range that a receiver used is farther off

/// The field as an angle within [low, high] degrees, in radians; NaN where it is none.
double angle_rad(std::string_view field, double low_deg, double high_deg) {
  const auto degrees = to_number(field);
  return degrees && *degrees >= low_deg && *degrees <= high_deg ? degrees_to_radians(*degrees)
                                                                : SatelliteObservation::kUnknown;
}

/// Step of a number with so many decimals.
double step_of(std::string_view field) {
  const std::size_t point = field.find('.');
  return point == std::string_view::npos ? 1.0 : std::pow(10.0, -static_cast<double>(field.size() - point - 1));
}

/// By the signal id of NMEA 4.10: 1 is the first signal of each system (L1 C/A, G1 C/A, B1I), but 7 of Galileo (E1).
int signal_rank(Constellation system, std::string_view signal) {
  const bool is_first = signal.empty() || signal == "0" || signal == (system == Constellation::kGalileo ? "7" : "1");
  return is_first || signal.size() != 1 ? 0 : signal[0];
}

}  // namespace

void NmeaSky::add_gsv(const NmeaSentence& sentence) {
  constexpr std::size_t kBefore = 3;  // sentences, number of this one, satellites in view
  constexpr std::size_t kEach = 4;    // number, elevation, azimuth, C/N0
  constexpr std::size_t kMost = 4;    // satellites a sentence
  has_gsv_ = true;
  if (sentence.fields.size() <= kBefore) return;
  // Behind the satellites may stand the signal, and with Quectel the system too. Some leave out a last C/N0.
  const std::size_t behind = sentence.fields.size() - kBefore;
  const std::size_t count = std::min(kMost, behind / kEach + (behind % kEach == 3 ? 1 : 0));
  const bool has_system_id = behind == count * kEach + 2;
  const Constellation system =
      nmea_system(sentence.talker, has_system_id ? sentence.field(sentence.fields.size() - 1) : std::string_view());
  const int rank = signal_rank(system, sentence.field(kBefore + count * kEach));
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t at = kBefore + kEach * i;
    const auto number = to_count(sentence.field(at));
    if (!number) continue;
    const auto id = nmea_satellite_id(system, *number);
    if (!id) {
      ++unknown_numbers_;
      continue;
    }
    const auto [place, is_new] = in_view_.try_emplace(*id);
    SatelliteObservation& satellite = place->second.satellite;
    satellite.id = *id;
    const LookAngles look{angle_rad(sentence.field(at + 2), 0.0, 360.0),
                          angle_rad(sentence.field(at + 1), -90.0, 90.0)};
    if (is_new || (std::isfinite(look.azimuth_rad) && std::isfinite(look.elevation_rad))) {
      satellite.look = look;
      if (satellite.look.azimuth_rad >= 2.0 * kPi) satellite.look.azimuth_rad = 0.0;
      const double step = std::min(step_of(sentence.field(at + 1)), step_of(sentence.field(at + 2)));
      angle_resolution_rad_ = std::max(angle_resolution_rad_, degrees_to_radians(step));
    }
    const double cn0 = to_number(sentence.field(at + 3)).value_or(0.0);
    const bool is_tracked = cn0 > 0.0 && cn0 <= kMostCn0_dbhz;
    place->second.add_signal(rank, is_tracked ? cn0 : SatelliteObservation::kUnknown);
  }
}

void NmeaSky::add_gsa(const NmeaSentence& sentence) {
  constexpr std::size_t kFirst = 2;
  constexpr std::size_t kCount = 12;
  constexpr std::size_t kSystemId = 17;
  UsedList list{nmea_system(sentence.talker, sentence.field(kSystemId)), sentence.talker, {}};
  for (std::size_t i = 0; i < kCount; ++i) {
    const auto number = to_count(sentence.field(kFirst + i));
    list.satellites.push_back(number ? nmea_satellite_id(list.system, *number) : std::nullopt);
    // Talker GN before NMEA 4.10: the satellites say which system it is.
    if (list.system == Constellation::kUnknown && list.satellites.back()) {
      list.system = clock_of(list.satellites.back()->constellation);
    }
  }
  used_.push_back(std::move(list));
}

void NmeaSky::add_grs(const NmeaSentence& sentence) {
  constexpr std::size_t kFirst = 2;
  constexpr std::size_t kCount = 12;
  constexpr std::size_t kSystemId = 14;
  ResidualList list{nmea_system(sentence.talker, sentence.field(kSystemId)),
                    sentence.talker,
                    std::string(sentence.field(kSystemId + 1)),
                    {}};
  for (std::size_t i = 0; i < kCount; ++i) {
    const auto residual = to_number(sentence.field(kFirst + i));
    const bool is_known = residual && std::abs(*residual) <= kMostResidual_m;
    list.residuals_m.push_back(is_known ? *residual : SatelliteObservation::kUnknown);
  }
  residuals_.push_back(std::move(list));
}

/// The GSA whose satellites a GRS is about; null where there is none.
const NmeaSky::UsedList* NmeaSky::list_of(std::size_t residual_list) const {
  const ResidualList& residuals = residuals_[residual_list];
  std::size_t before = 0;  // GRS of the same system and signal
  for (std::size_t i = 0; i < residual_list; ++i) {
    const ResidualList& other = residuals_[i];
    if (other.system == residuals.system && other.talker == residuals.talker && other.signal == residuals.signal) {
      ++before;
    }
  }
  for (const UsedList& used : used_) {
    const bool is_of_it =
        residuals.system == Constellation::kUnknown ? used.talker == residuals.talker : used.system == residuals.system;
    if (is_of_it && before-- == 0) return &used;
  }
  return nullptr;
}

std::vector<SatelliteObservation> NmeaSky::satellites() const {
  std::map<SatelliteId, SatelliteObservation> all;
  for (const auto& [id, each] : in_view_) all.emplace(id, each.satellite);
  for (std::size_t i = 0; i < residuals_.size(); ++i) {
    const UsedList* used = list_of(i);
    if (used == nullptr) continue;
    for (std::size_t k = 0; k < residuals_[i].residuals_m.size(); ++k) {
      if (!used->satellites[k]) continue;
      const auto satellite = all.find(*used->satellites[k]);
      if (satellite == all.end() || std::isfinite(satellite->second.residual_m)) continue;
      satellite->second.residual_m = -residuals_[i].residuals_m[k];
    }
  }
  std::vector<SatelliteObservation> list;
  for (const auto& [id, satellite] : all) list.push_back(satellite);
  return list;
}

}  // namespace urban_gnss
