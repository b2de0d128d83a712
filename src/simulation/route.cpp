#include "urban_gnss_localization/simulation/route.hpp"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <sstream>
#include <stdexcept>

#include "urban_gnss_localization/simulation/world.hpp"

namespace urban_gnss {
namespace {

constexpr double kSamePlace_m = 1e-6;
constexpr double kLongest_m = 1e6;

bool is_same_place(const Eigen::Vector2d& a, const Eigen::Vector2d& b) { return (a - b).norm() < kSamePlace_m; }

[[noreturn]] void refuse(const std::string& fault) { throw std::invalid_argument("route: " + fault); }

/// Each position replaced by the mean of those within half of `window_s`.
std::vector<Eigen::Vector2d> moving_average(const std::vector<double>& stamps_s,
                                            const std::vector<Eigen::Vector2d>& positions, double window_s) {
  std::vector<Eigen::Vector2d> smooth;
  smooth.reserve(positions.size());
  for (std::size_t i = 0; i < positions.size(); ++i) {
    // Symmetric in the number of positions, so that the average does not lag or lead where the ends or a gap are near.
    std::size_t reach = 0;
    while (reach < i && i + reach + 1 < positions.size() &&
           stamps_s[i + reach + 1] - stamps_s[i - reach - 1] <= window_s) {
      ++reach;
    }
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    for (std::size_t j = i - reach; j <= i + reach; ++j) sum += positions[j];
    smooth.push_back(sum / static_cast<double>(2 * reach + 1));
  }
  return smooth;
}

void require_track(const std::vector<double>& stamps_s, const std::vector<Eigen::Vector2d>& positions) {
  if (stamps_s.size() != positions.size()) refuse("a track needs a stamp for each position");
  for (std::size_t i = 0; i < stamps_s.size(); ++i) {
    if (!std::isfinite(stamps_s[i]) || !positions[i].allFinite()) refuse("a track must be finite");
    if (i > 0 && !(stamps_s[i] > stamps_s[i - 1])) refuse("a track's stamps must increase");
  }
}

}  // namespace

Pose2 Route::start() const {
  const Eigen::Vector2d from = waypoints.at(0).position;
  for (const RouteWaypoint& waypoint : waypoints) {
    const Eigen::Vector2d ahead = waypoint.position - from;
    if (ahead.norm() >= kSamePlace_m) return {from.x(), from.y(), std::atan2(ahead.y(), ahead.x())};
  }
  return {from.x(), from.y(), 0.0};
}

double Route::length_m() const {
  double length = 0.0;
  for (std::size_t i = 1; i < waypoints.size(); ++i)
    length += (waypoints[i].position - waypoints[i - 1].position).norm();
  if (loop && !waypoints.empty()) length += (waypoints.front().position - waypoints.back().position).norm();
  return length;
}

void require_drivable(const Route& route) {
  for (std::size_t i = 0; i < route.waypoints.size(); ++i) {
    const RouteWaypoint& waypoint = route.waypoints[i];
    const std::string name = "waypoint " + std::to_string(i) + ": ";
    if (!waypoint.position.allFinite()) refuse(name + "the position must be finite");
    if (!is_in_world(waypoint.position)) refuse(name + "the position is more than 100 km from the origin");
    if (!(waypoint.speed_mps > 0.0 && std::isfinite(waypoint.speed_mps))) refuse(name + "the speed must be > 0");
    if (!(waypoint.stop_s >= 0.0 && std::isfinite(waypoint.stop_s))) refuse(name + "the stop must be >= 0");
  }
  if (route.length_m() > kLongest_m) refuse("is longer than 1000 km");
  for (const RouteWaypoint& waypoint : route.waypoints) {
    if (!is_same_place(waypoint.position, route.waypoints.front().position)) return;
  }
  refuse("needs two waypoints at different positions");
}

Route resample_track(const std::vector<double>& stamps_s, const std::vector<Eigen::Vector2d>& positions,
                     const TrackResampling& resampling) {
  require_track(stamps_s, positions);
  const std::vector<Eigen::Vector2d> smooth = moving_average(stamps_s, positions, resampling.smoothing_s);
  Route route;
  if (!smooth.empty()) route.waypoints.push_back({smooth[0], resampling.min_speed_mps, 0.0});
  double moved_s = 0.0;
  double stood_s = 0.0;
  for (std::size_t i = 1; i < smooth.size(); ++i) {
    const double duration = stamps_s[i] - stamps_s[i - 1];
    const bool stands = (smooth[i] - smooth[i - 1]).norm() < resampling.standstill_speed_mps * duration;
    (stands ? stood_s : moved_s) += duration;
    RouteWaypoint& last = route.waypoints.back();
    const double distance = (smooth[i] - last.position).norm();
    if (distance < resampling.spacing_m) continue;
    // A drift below standstill speed can come this far without ever having moved.
    if (moved_s > 0.0) last.speed_mps = std::max(distance / moved_s, resampling.min_speed_mps);
    if (stood_s >= resampling.min_stop_s) last.stop_s = stood_s;
    route.waypoints.push_back({smooth[i], last.speed_mps, 0.0});
    moved_s = stood_s = 0.0;
  }
  require_drivable(route);
  return route;
}

Route read_track(const std::string& path, const TrackResampling& resampling) {
  std::ifstream file(path);
  if (!file) throw std::runtime_error(path + ": cannot be read");
  std::vector<double> stamps_s;
  std::vector<Eigen::Vector2d> positions;
  std::string line;
  bool has_names = false;
  for (int number = 1; std::getline(file, line); ++number) {
    if (!line.empty() && line.back() == '\r') line.pop_back();
    if (line.empty() || line[0] == '#') continue;
    const auto fail = [&](const std::string& fault) {
      throw std::runtime_error(path + ":" + std::to_string(number) + ": " + fault);
    };
    if (!has_names) {
      if (line.rfind("stamp,x,y", 0) != 0) fail("the columns must be stamp,x,y,...");
      has_names = true;
      continue;
    }
    std::replace(line.begin(), line.end(), ',', ' ');
    std::istringstream columns(line);
    double stamp = 0.0;
    Eigen::Vector2d position;
    if (!(columns >> stamp >> position.x() >> position.y())) fail("expected the numbers stamp,x,y");
    stamps_s.push_back(stamp);
    positions.push_back(position);
  }
  try {
    return resample_track(stamps_s, positions, resampling);
  } catch (const std::invalid_argument& error) {
    throw std::runtime_error(path + ": " + error.what());
  }
}

}  // namespace urban_gnss
