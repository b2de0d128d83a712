#include "urban_gnss_localization/gnss/datum_initializer.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <utility>

#include "urban_gnss_localization/geometry/local_frame.hpp"
#include "urban_gnss_localization/gnss/fix_validation.hpp"

namespace urban_gnss {
namespace {

GeodeticPosition to_position(const std::vector<double>& datum) { return {datum[0], datum[1], datum[2]}; }

/// The middle value, or the mean of the two middle values. Requires at least one.
double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  if (values.size() % 2 == 1) return *middle;
  return 0.5 * (*middle + *std::max_element(values.begin(), middle));
}

GeodeticPosition on_ellipsoid(const GeodeticPosition& position) {
  return {position.latitude_deg, position.longitude_deg, 0.0};
}

}  // namespace

void DatumParameters::check(std::vector<std::string>& faults) const {
  if (datum.size() == 3) {
    for (const std::string& fault : position_faults(to_position(datum))) faults.push_back("datum: " + fault);
  } else if (!datum.empty()) {
    faults.push_back("datum has " + std::to_string(datum.size()) + (datum.size() == 1 ? " number" : " numbers") +
                     ": must be empty, or latitude, longitude, altitude");
  }
}

DatumInitializer::DatumInitializer(DatumParameters parameters) : parameters_(std::move(parameters)) {}

std::optional<GeodeticPosition> DatumInitializer::fixed() const {
  if (parameters_.datum.size() != 3) return std::nullopt;
  return to_position(parameters_.datum);
}

std::optional<GeodeticPosition> DatumInitializer::add(const RawFix& raw) {
  if (const auto datum = fixed()) return datum;
  const bool is_known =
      std::any_of(window_.begin(), window_.end(), [&](const RawFix& known) { return known.stamp == raw.stamp; });
  if (is_usable_position(raw) && !is_known) {
    window_.push_back(raw);
    if (window_.size() > static_cast<std::size_t>(parameters_.datum_fix_count)) window_.pop_front();
  }
  const Agreement now = agreement();
  if (!is_complete(now)) return std::nullopt;
  return now.median;
}

void DatumInitializer::reset() { window_.clear(); }

std::string DatumInitializer::waiting_for() const {
  const Agreement now = agreement();
  if (fixed() || is_complete(now)) return "";
  return std::to_string(now.count) + " of " + std::to_string(parameters_.datum_fix_count) + " agreeing fixes";
}

DatumInitializer::Agreement DatumInitializer::agreement() const {
  if (window_.empty()) return {};
  // Medians of longitudes make no sense across the 180° meridian or around a pole; medians in a plane do.
  const LocalFrame plane(on_ellipsoid(window_.front().position));
  std::vector<double> east, north, up, altitudes;
  for (const RawFix& raw : window_) {
    const Eigen::Vector3d local = plane.to_local(on_ellipsoid(raw.position));
    east.push_back(local.x());
    north.push_back(local.y());
    up.push_back(local.z());
    if (is_altitude(raw.position.altitude_m)) altitudes.push_back(raw.position.altitude_m);
  }
  Agreement result;
  result.median = on_ellipsoid(plane.to_geodetic({median(east), median(north), median(up)}));
  const LocalFrame at_median(result.median);
  for (const RawFix& raw : window_) {
    const double distance = at_median.to_local(on_ellipsoid(raw.position)).norm();
    if (distance <= parameters_.datum_max_spread) ++result.count;
  }
  result.median.altitude_m = altitudes.empty() ? 0.0 : median(altitudes);
  return result;
}

bool DatumInitializer::is_complete(const Agreement& agreement) const {
  return agreement.count == static_cast<std::size_t>(parameters_.datum_fix_count);
}

}  // namespace urban_gnss
