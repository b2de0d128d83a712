#include "urban_gnss_localization/evaluation/track_export.hpp"

#include <cmath>
#include <cstdio>
#include <ctime>
#include <ostream>
#include <stdexcept>

#include "urban_gnss_localization/evaluation/report_json.hpp"

namespace urban_gnss {
namespace {

constexpr Stamp kLeastInterval = std::chrono::milliseconds(200);

struct Place {
  Stamp stamp{0};
  double latitude_deg{0.0};
  double longitude_deg{0.0};
};
using Line = std::vector<Place>;

const LocalFrame& map_of(const TrackReport& report) {
  if (!report.map) throw std::invalid_argument(report.name + ": without a datum it has no latitude and longitude");
  return *report.map;
}

Place place_of(const LocalFrame& map, Stamp stamp, const Eigen::Vector2d& position) {
  const GeodeticPosition place = map.to_geodetic({position.x(), position.y(), 0.0});
  return {stamp, place.latitude_deg, place.longitude_deg};
}

/// What is finite, a line for each part between gaps.
std::vector<Line> lines_of(const LocalFrame& map, const Trajectory& trajectory, Stamp max_gap) {
  std::vector<Line> lines;
  Stamp last{0};
  for (const TimedPose& pose : trajectory) {
    if (!pose.pose.position().allFinite()) continue;
    const bool begins = lines.empty() || pose.stamp - last > max_gap;
    last = pose.stamp;
    if (begins) {
      lines.emplace_back();
    } else if (pose.stamp - lines.back().back().stamp < kLeastInterval) {
      continue;
    }
    lines.back().push_back(place_of(map, pose.stamp, pose.pose.position()));
  }
  return lines;
}

std::string decision_of(const DecidedFix& fix) { return fix.outcome ? to_string(fix.outcome->decision) : "unknown"; }

bool was_rejected(const DecidedFix& fix) { return fix.outcome && is_rejected(fix.outcome->decision); }

std::string degrees(double value) {
  char text[32];
  std::snprintf(text, sizeof(text), "%.8f", value);
  return text;
}

/// Text between tags; control characters, which XML cannot hold, are left out.
std::string xml(const std::string& text) {
  std::string escaped;
  for (const char c : text) {
    switch (c) {
      case '&': escaped += "&amp;"; break;
      case '<': escaped += "&lt;"; break;
      case '>': escaped += "&gt;"; break;
      case '"': escaped += "&quot;"; break;
      default:
        if (static_cast<unsigned char>(c) >= 0x20) escaped += c;
    }
  }
  return escaped;
}

/// What stands beside a fix on a map.
std::string description_of(const DecidedFix& fix) {
  std::string text = decision_of(fix);
  if (fix.outcome && !fix.outcome->reason.empty()) text += ": " + fix.outcome->reason;
  return text;
}

void write_kml_lines(std::ostream& out, const std::string& name, const std::string& style,
                     const std::vector<Line>& lines) {
  if (lines.empty()) return;
  out << "<Placemark><name>" << xml(name) << "</name><styleUrl>#" << style << "</styleUrl><MultiGeometry>\n";
  for (const Line& line : lines) {
    out << "<LineString><tessellate>1</tessellate><coordinates>\n";
    for (const Place& place : line) out << degrees(place.longitude_deg) << ',' << degrees(place.latitude_deg) << '\n';
    out << "</coordinates></LineString>\n";
  }
  out << "</MultiGeometry></Placemark>\n";
}

void write_gpx_place(std::ostream& out, const Place& place) {
  out << "<trkpt lat=\"" << degrees(place.latitude_deg) << "\" lon=\"" << degrees(place.longitude_deg) << "\"><time>"
      << utc_text(place.stamp) << "</time></trkpt>\n";
}

void write_gpx_track(std::ostream& out, const std::string& name, const std::vector<Line>& lines) {
  if (lines.empty()) return;
  out << "<trk><name>" << xml(name) << "</name>\n";
  for (const Line& line : lines) {
    out << "<trkseg>\n";
    for (const Place& place : line) write_gpx_place(out, place);
    out << "</trkseg>\n";
  }
  out << "</trk>\n";
}

/// Of the fixes that were rejected, or of the others: nothing or one line.
std::vector<Line> fixes_as_line(const LocalFrame& map, const std::vector<DecidedFix>& fixes, bool rejected) {
  Line line;
  for (const DecidedFix& fix : fixes) {
    if (was_rejected(fix) == rejected) line.push_back(place_of(map, fix.stamp, fix.place));
  }
  return line.empty() ? std::vector<Line>{} : std::vector<Line>{line};
}

nlohmann::json coordinates(const Place& place) { return {place.longitude_deg, place.latitude_deg}; }

nlohmann::json line_feature(const std::string& name, const std::string& what, const std::vector<Line>& lines) {
  nlohmann::json parts = nlohmann::json::array();
  for (const Line& line : lines) {
    nlohmann::json part = nlohmann::json::array();
    for (const Place& place : line) part.push_back(coordinates(place));
    if (part.size() == 1) part.push_back(part.front());  // a line has two places at least
    parts.push_back(part);
  }
  return {{"type", "Feature"},
          {"properties",
           {{"name", name},
            {"kind", what},
            {"begin", utc_text(lines.front().front().stamp)},
            {"end", utc_text(lines.back().back().stamp)}}},
          {"geometry", {{"type", "MultiLineString"}, {"coordinates", parts}}}};
}

nlohmann::json fix_feature(const std::string& name, const LocalFrame& map, const DecidedFix& fix) {
  nlohmann::json properties = {{"name", name},
                               {"kind", "fix"},
                               {"time", utc_text(fix.stamp)},
                               {"decision", decision_of(fix)},
                               {"sigma_m", number_or_null(fix.sigma_m)}};
  if (fix.outcome) {
    properties["reason"] = fix.outcome->reason;
    properties["nis"] = number_or_null(fix.outcome->nis);
  }
  return {{"type", "Feature"},
          {"properties", properties},
          {"geometry", {{"type", "Point"}, {"coordinates", coordinates(place_of(map, fix.stamp, fix.place))}}}};
}

}  // namespace

std::string utc_text(Stamp stamp) {
  const auto milliseconds = std::chrono::floor<std::chrono::milliseconds>(stamp).count();
  const auto part = ((milliseconds % 1000) + 1000) % 1000;
  const std::time_t seconds = static_cast<std::time_t>((milliseconds - part) / 1000);
  std::tm utc{};
  gmtime_r(&seconds, &utc);
  char date[32];
  std::strftime(date, sizeof(date), "%Y-%m-%dT%H:%M:%S", &utc);
  char text[48];
  std::snprintf(text, sizeof(text), "%s.%03dZ", date, static_cast<int>(part));
  return text;
}

void write_kml(std::ostream& out, const std::vector<TrackReport>& reports, Stamp max_gap) {
  out << R"(<?xml version="1.0" encoding="UTF-8"?>
<kml xmlns="http://www.opengis.net/kml/2.2"><Document>
<Style id="estimate"><LineStyle><color>ffb27200</color><width>3</width></LineStyle></Style>
<Style id="truth"><LineStyle><color>ff000000</color><width>2</width></LineStyle></Style>
<Style id="used"><IconStyle><color>ff739e00</color><scale>0.4</scale></IconStyle><LabelStyle><scale>0</scale></LabelStyle></Style>
<Style id="rejected"><IconStyle><color>ff1f12c1</color><scale>0.5</scale></IconStyle><LabelStyle><scale>0</scale></LabelStyle></Style>
)";
  for (const TrackReport& report : reports) {
    const LocalFrame& map = map_of(report);
    out << "<Folder><name>" << xml(report.name) << "</name>\n";
    write_kml_lines(out, "truth", "truth", lines_of(map, report.truth, max_gap));
    write_kml_lines(out, "estimate", "estimate", lines_of(map, report.estimate, max_gap));
    out << "<Folder><name>fixes</name>\n";
    for (const DecidedFix& fix : report.fixes) {
      const Place place = place_of(map, fix.stamp, fix.place);
      out << "<Placemark><name>" << decision_of(fix) << "</name><description>" << xml(description_of(fix))
          << "</description><TimeStamp><when>" << utc_text(fix.stamp) << "</when></TimeStamp><styleUrl>#"
          << (was_rejected(fix) ? "rejected" : "used") << "</styleUrl><Point><coordinates>"
          << degrees(place.longitude_deg) << ',' << degrees(place.latitude_deg)
          << "</coordinates></Point></Placemark>\n";
    }
    out << "</Folder></Folder>\n";
  }
  out << "</Document></kml>\n";
}

void write_gpx(std::ostream& out, const std::vector<TrackReport>& reports, Stamp max_gap) {
  out << R"(<?xml version="1.0" encoding="UTF-8"?>
<gpx version="1.1" creator="urban_gnss_localization" xmlns="http://www.topografix.com/GPX/1/1">
)";
  for (const TrackReport& report : reports) {
    const LocalFrame& map = map_of(report);
    write_gpx_track(out, report.name, lines_of(map, report.estimate, max_gap));
    write_gpx_track(out, report.name + ": fixes", fixes_as_line(map, report.fixes, false));
    write_gpx_track(out, report.name + ": rejected fixes", fixes_as_line(map, report.fixes, true));
    write_gpx_track(out, report.name + ": truth", lines_of(map, report.truth, max_gap));
  }
  out << "</gpx>\n";
}

void write_geojson(std::ostream& out, const std::vector<TrackReport>& reports, Stamp max_gap) {
  nlohmann::json features = nlohmann::json::array();
  for (const TrackReport& report : reports) {
    const LocalFrame& map = map_of(report);
    const auto truth = lines_of(map, report.truth, max_gap);
    const auto estimate = lines_of(map, report.estimate, max_gap);
    if (!truth.empty()) features.push_back(line_feature(report.name, "truth", truth));
    if (!estimate.empty()) features.push_back(line_feature(report.name, "estimate", estimate));
    for (const DecidedFix& fix : report.fixes) features.push_back(fix_feature(report.name, map, fix));
  }
  out << nlohmann::json{{"type", "FeatureCollection"}, {"features", features}}.dump(
             -1, ' ', false, nlohmann::json::error_handler_t::replace)
      << '\n';
}

}  // namespace urban_gnss
