#pragma once

#include <iosfwd>
#include <string>
#include <vector>

#include "urban_gnss_localization/evaluation/track_report.hpp"

namespace urban_gnss {

/// UTC as ISO 8601 has it, e.g. "2021-05-17T02:11:03.250Z".
std::string utc_text(Stamp stamp);

/// Tracks on maps: estimates, fixes with their decisions, and truths. Poses at least 0.2 s apart, with a new line where
/// the estimate has a gap of more than `max_gap`. All throw std::invalid_argument where a report has no map.

/// For Google Earth, Mapviz, QGIS: OGC KML 2.2, a folder a report.
void write_kml(std::ostream& out, const std::vector<TrackReport>& reports, Stamp max_gap);
/// For phones, JOSM, viking: GPX 1.1, a track each of estimate, fixes that were used, fixes that were not, truth.
void write_gpx(std::ostream& out, const std::vector<TrackReport>& reports, Stamp max_gap);
/// For QGIS, geojson.io, web maps: RFC 7946, a line each of estimate and truth, a point for each fix.
void write_geojson(std::ostream& out, const std::vector<TrackReport>& reports, Stamp max_gap);

}  // namespace urban_gnss
