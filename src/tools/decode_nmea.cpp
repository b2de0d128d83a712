// Decodes a log of NMEA 0183 to lines of JSON: fix, velocity and satellites of each solution.

#include <cmath>
#include <iostream>
#include <nlohmann/json.hpp>

#include "command_line.hpp"
#include "replay/nmea_log.hpp"
#include "urban_gnss_localization/evaluation/stamp_text.hpp"
#include "urban_gnss_localization/geometry/angles.hpp"

using namespace urban_gnss;
using nlohmann::json;

namespace {

json number(double value) { return std::isfinite(value) ? json(value) : json(); }

json line_of(const RawFix& fix) {
  json line = {{"class", "fix"}, {"stamp", format_stamp(fix.stamp)}, {"has_fix", fix.has_fix}};
  if (!fix.has_fix) return line;
  line["lat"] = number(fix.position.latitude_deg);
  line["lon"] = number(fix.position.longitude_deg);
  line["alt"] = number(fix.position.altitude_m);
  if (fix.covariance_type != CovarianceType::kUnknown) {
    const auto& c = fix.covariance;
    line["covariance"] = {c(0, 0), c(0, 1), c(1, 1), c(2, 2)};
    line["covariance_is"] = fix.covariance_type == CovarianceType::kKnown ? "declared" : "from DOP";
  }
  return line;
}

json line_of(const RawVelocity& velocity) {
  return {{"class", "velocity"},
          {"stamp", format_stamp(velocity.stamp)},
          {"east", velocity.velocity.x()},
          {"north", velocity.velocity.y()}};
}

json line_of(const SatelliteEpoch& epoch) {
  json list = json::array();
  for (const SatelliteObservation& satellite : epoch.satellites) {
    list.push_back({{"gnssid", static_cast<int>(satellite.id.constellation)},
                    {"svid", satellite.id.svid},
                    {"name", satellite_name(satellite.id)},
                    {"az", number(radians_to_degrees(satellite.look.azimuth_rad))},
                    {"el", number(radians_to_degrees(satellite.look.elevation_rad))},
                    {"cn0", number(satellite.cn0_dbhz)},
                    {"residual", number(satellite.residual_m)}});
  }
  return {{"class", "satellites"}, {"stamp", format_stamp(epoch.stamp)}, {"satellites", std::move(list)}};
}

void print_lines(const ReceiverOutput& output) {
  for (const RawFix& fix : output.fixes) std::cout << line_of(fix) << '\n';
  for (const RawVelocity& velocity : output.velocities) std::cout << line_of(velocity) << '\n';
  for (const SatelliteEpoch& epoch : output.satellites) std::cout << line_of(epoch) << '\n';
}

}  // namespace

int main(int argc, char** argv) {
  std::string file, date;
  bool by_lines = false, wants_summary = false;
  CommandLine line("decode_nmea",
                   "Decodes a log of NMEA 0183 as the receivers' node does: a line of JSON for each fix, velocity and "
                   "list of satellites; angles in degrees, covariance xx, xy, yy, zz in m^2, residual in m.");
  line.app().add_option("file", file, "the log; binary messages between its sentences do no harm")->required();
  line.app().add_option("--nmea-date", date, "YYYY-MM-DD of the first sentence, in place of the log's own dates");
  line.app().add_flag("--by-lines", by_lines,
                      "decode as live, where each sentence has an arrival stamp; a stamp is the number of the line, in "
                      "nanoseconds");
  line.app().add_flag("--summary", wants_summary, "only counts");
  return line.run(argc, argv, [&] {
    const auto day = date.empty() ? std::nullopt : std::optional<Day>(parse_date(date));
    const NmeaLog log = by_lines ? read_nmea_log_by_lines(file) : read_nmea_log(file, day);
    if (!wants_summary) {
      for (const TimedOutput& solution : to_recording(log, file).outputs) print_lines(solution.output);
    }
    for (const std::string& warning : log.output.warnings) std::cerr << warning << '\n';
    std::ostream& summary = wants_summary ? std::cout : std::cerr;
    summary << summary_of(log) << '\n';
  });
}
