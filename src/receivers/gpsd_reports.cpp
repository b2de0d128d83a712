#include "urban_gnss_localization/receivers/gpsd_reports.hpp"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "urban_gnss_localization/geometry/angles.hpp"
#include "urban_gnss_localization/receivers/nmea_fields.hpp"
#include "urban_gnss_localization/receivers/nmea_satellite_id.hpp"

namespace urban_gnss {
namespace {

using nlohmann::json;

/// Finite and within the bounds; else NaN.
double number(const json& report, const char* key, double low = -1e9, double high = 1e9) {
  const auto found = report.find(key);
  if (found == report.end() || !found->is_number()) return kGpsdUnknown;
  const auto value = found->get<double>();
  return value >= low && value <= high ? value : kGpsdUnknown;
}

int integer(const json& report, const char* key, int missing) {
  const double value = number(report, key);
  return std::isfinite(value) ? static_cast<int>(value) : missing;
}

std::string text(const json& report, const char* key) {
  const auto found = report.find(key);
  return found != report.end() && found->is_string() ? found->get<std::string>() : std::string();
}

bool flag(const json& report, const char* key) {
  const auto found = report.find(key);
  return found != report.end() && found->is_boolean() && found->get<bool>();
}

GpsdPosition to_position(const json& report) {
  constexpr double kMostError = 1e6;
  GpsdPosition position;
  position.device = text(report, "device");
  position.time = parse_gpsd_time(text(report, "time"));
  position.mode = integer(report, "mode", 0);
  position.status = integer(report, "status", 0);
  position.latitude_deg = number(report, "lat", -90.0, 90.0);
  position.longitude_deg = number(report, "lon", -180.0, 180.0);
  position.altitude_m = number(report, "altHAE");
  if (!std::isfinite(position.altitude_m)) position.altitude_m = number(report, "alt");  // before 3.20
  position.speed_mps = number(report, "speed", 0.0);
  position.course_rad = degrees_to_radians(number(report, "track", 0.0, 360.0));
  position.epx_m = number(report, "epx", 1e-4, kMostError);
  position.epy_m = number(report, "epy", 1e-4, kMostError);
  position.epv_m = number(report, "epv", 1e-4, kMostError);
  position.eph_m = number(report, "eph", 1e-4, kMostError);
  position.eps_mps = number(report, "eps", 1e-4, kMostError);
  return position;
}

GpsdErrors to_errors(const json& report) {
  constexpr double kMostError = 1e5;
  return {text(report, "device"), parse_gpsd_time(text(report, "time")), number(report, "lon", 1e-4, kMostError),
          number(report, "lat", 1e-4, kMostError), number(report, "alt", 1e-4, kMostError)};
}

/// gpsd names a satellite by gnssid and svid; before 3.19 by a number that all systems share.
std::optional<SatelliteId> to_id(const json& satellite) {
  const int gnssid = integer(satellite, "gnssid", -1);
  const int svid = integer(satellite, "svid", 0);
  if (gnssid < 0) return nmea_satellite_id(Constellation::kUnknown, integer(satellite, "PRN", 0));
  if (gnssid > static_cast<int>(Constellation::kNavic) || svid < 1 || svid > 999) return std::nullopt;
  return SatelliteId{static_cast<Constellation>(gnssid), svid};
}

/// A satellite is listed once for each of its signals.
void add_satellite(const json& satellite, GpsdSky& sky) {
  constexpr double kMostCn0_dbhz = 99.0;
  constexpr double kMostResidual_m = 100000.0;
  const auto id = to_id(satellite);
  if (!id) return;
  SatelliteSignals& each = sky.satellites[*id];
  each.satellite.id = *id;
  const double azimuth_deg = number(satellite, "az", 0.0, 360.0);
  const double elevation_deg = number(satellite, "el", -90.0, 90.0);
  each.satellite.look = {degrees_to_radians(azimuth_deg == 360.0 ? 0.0 : azimuth_deg),
                         degrees_to_radians(elevation_deg)};
  for (const double angle : {azimuth_deg, elevation_deg}) {
    if (std::isfinite(angle) && angle != std::round(angle)) sky.has_whole_degrees = false;
  }
  each.add_signal(integer(satellite, "sigid", 0), number(satellite, "ss", 0.1, kMostCn0_dbhz));
  if (!flag(satellite, "used")) return;
  const double residual_m = number(satellite, "prRes", -kMostResidual_m, kMostResidual_m);
  if (std::isfinite(residual_m)) each.satellite.residual_m = residual_m;
}

GpsdSky to_sky(const json& report) {
  GpsdSky sky;
  sky.device = text(report, "device");
  sky.time = parse_gpsd_time(text(report, "time"));
  sky.hdop = number(report, "hdop");
  sky.vdop = number(report, "vdop");
  const auto satellites = report.find("satellites");
  if (satellites == report.end() || !satellites->is_array()) return sky;
  sky.has_list = true;
  for (const json& satellite : *satellites) {
    if (satellite.is_object()) add_satellite(satellite, sky);
  }
  return sky;
}

GpsdDevices to_devices(const json& report) {
  GpsdDevices devices;
  const auto add = [&](const json& device) {
    if (device.is_object() && !text(device, "path").empty())
      devices.drivers[text(device, "path")] = text(device, "driver");
  };
  add(report);
  const auto list = report.find("devices");
  if (list != report.end() && list->is_array()) std::for_each(list->begin(), list->end(), add);
  return devices;
}

}  // namespace

void GpsdSky::merge(const GpsdSky& other) {
  if (std::isfinite(other.hdop)) hdop = other.hdop;
  if (std::isfinite(other.vdop)) vdop = other.vdop;
  has_list = has_list || other.has_list;
  has_whole_degrees = has_whole_degrees && other.has_whole_degrees;
  for (const auto& [id, newer] : other.satellites) satellites[id] = newer;
}

std::optional<Stamp> parse_gpsd_time(std::string_view text) {
  if (text.size() < 20 || text.back() != 'Z' || text[4] != '-' || text[7] != '-' || text[10] != 'T')
    return std::nullopt;
  if (text[13] != ':' || text[16] != ':') return std::nullopt;
  const auto year = to_count(text.substr(0, 4));
  const auto month = to_count(text.substr(5, 2));
  const auto day = to_count(text.substr(8, 2));
  if (!year || !month || !day) return std::nullopt;
  const auto date = to_day(*year, *month, *day);
  std::string time(text.substr(11, text.size() - 12));
  time.erase(std::remove(time.begin(), time.end(), ':'), time.end());
  const auto time_of_day = to_time_of_day(time);
  if (!date || !time_of_day) return std::nullopt;
  return std::chrono::hours(24 * *date) + *time_of_day;
}

GpsdReport parse_gpsd_report(std::string_view line) {
  const json report = json::parse(line.begin(), line.end(), nullptr, false);
  if (!report.is_object()) return GpsdUnreadable{};
  const std::string kind = text(report, "class");
  if (kind == "TPV") return to_position(report);
  if (kind == "SKY") return to_sky(report);
  if (kind == "GST") return to_errors(report);
  if (kind == "VERSION") return GpsdVersion{text(report, "release"), integer(report, "proto_major", 0)};
  if (kind == "DEVICE" || kind == "DEVICES") return to_devices(report);
  if (kind == "ERROR") return GpsdError{text(report, "message")};
  return kind.empty() ? GpsdReport(GpsdUnreadable{}) : GpsdReport(GpsdOther{});
}

}  // namespace urban_gnss
