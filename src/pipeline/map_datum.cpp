#include "urban_gnss_localization/pipeline/map_datum.hpp"

#include <sstream>

namespace urban_gnss {

MapDatum::MapDatum(const DatumParameters& parameters) : parameters_(parameters), initializer_(parameters) { reset(); }

void MapDatum::reset() {
  initializer_.reset();
  if (frame_) return;
  if (const auto datum = initializer_.fixed()) use(*datum, "parameter");
}

void MapDatum::add(const RawFix& fix) {
  if (frame_) return;
  if (const auto datum = initializer_.add(fix)) {
    use(*datum, std::to_string(parameters_.datum_fix_count) + " agreeing fixes");
  }
}

bool MapDatum::set(const GeodeticPosition& datum, const std::string& source) {
  const bool is_another = !frame_ || !(frame_->datum() == datum);
  if (is_another) use(datum, source);
  return is_another;
}

void MapDatum::use(const GeodeticPosition& datum, const std::string& source) {
  frame_ = LocalFrame(datum);  // throws before anything changes
  source_ = source;
}

std::string MapDatum::describe() const {
  const GeodeticPosition& datum = frame_->datum();
  std::ostringstream text;
  text.precision(10);
  text << "datum from " << source_ << ": latitude " << datum.latitude_deg << ", longitude " << datum.longitude_deg
       << ", altitude " << datum.altitude_m << " m";
  return text.str();
}

}  // namespace urban_gnss
