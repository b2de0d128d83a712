#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "urban_gnss_localization/common/parameters.hpp"
#include "urban_gnss_localization/geometry/pose2.hpp"
#include "urban_gnss_localization/motion/motion_model.hpp"

namespace urban_gnss {

struct RouteWaypoint {
  Eigen::Vector2d position{Eigen::Vector2d::Zero()};  ///< m, map frame
  double speed_mps{10.0};                             ///< from here on, > 0
  double stop_s{0.0};                                 ///< parked here so long
};

/// A polyline to drive along.
struct Route {
  std::vector<RouteWaypoint> waypoints;
  bool loop{false};  ///< the last waypoint is followed by the first, again and again

  /// On the first waypoint, towards the next that is elsewhere.
  Pose2 start() const;
  /// m, of one lap.
  double length_m() const;
};

/// Throws std::invalid_argument with the fault where a route cannot be driven: fewer than two different positions,
/// something not finite, a position out of the world, more than 1000 km, a speed that is not positive, a stop that is
/// negative.
void require_drivable(const Route& route);

/// How a recorded track becomes a route.
struct TrackResampling {
  double spacing_m{2.0};             ///< between waypoints
  double smoothing_s{1.0};           ///< length of the moving average over positions
  double standstill_speed_mps{0.3};  ///< below it the robot stood: noise moves positions also then
  double min_stop_s{2.0};            ///< a stand shorter than this is not made a stop
  double min_speed_mps{1.0};         ///< no waypoint asks for less
};

/// The route of a recorded track: `stamps_s` strictly increasing, one position (m, map frame) each. The positions are
/// averaged over time, then a waypoint is set wherever the track is `spacing_m` from the last; its speed is the
/// distance to the next by the time in which the robot moved, its stop the time in which it stood in between. Throws
/// std::invalid_argument where the track cannot be used.
Route resample_track(const std::vector<double>& stamps_s, const std::vector<Eigen::Vector2d>& positions,
                     const TrackResampling& resampling = {});

/// Reads a track of columns stamp,x,y,... (s, m) after optional comment lines, which start with '#', and a line of
/// column names. Throws std::runtime_error with file and line where it cannot be read.
Route read_track(const std::string& path, const TrackResampling& resampling = {});

struct RouteFollowerParameters {
  double corner_radius{6.0};
  double max_lateral_acceleration{2.0};
  double acceleration{1.5};
  double deceleration{1.5};
  double lookahead_time{0.5};
  double min_lookahead{2.0};
  double crawl_speed{0.5};

  void visit(ParameterVisitor& v) {
    v("corner_radius", corner_radius, positive(), "m", "to which corners are rounded; shorter legs allow less");
    v("max_lateral_acceleration", max_lateral_acceleration, positive(), "m/s^2", "slows in curves");
    v("acceleration", acceleration, positive(), "m/s^2", "of the speed profile");
    v("deceleration", deceleration, positive(), "m/s^2", "of the speed profile");
    v("lookahead_time", lookahead_time, positive(), "", "s");
    v("min_lookahead", min_lookahead, positive(), "", "m");
    v("crawl_speed", crawl_speed, positive(), "m/s", "the least while under way");
  }
};

/// An autopilot on the TRUE pose: pure pursuit (Coulter, "Implementation of the Pure Pursuit Path Tracking Algorithm",
/// CMU-RI-TR-92-01) along the route with its corners rounded, at a speed profile that keeps
/// the limits of lateral acceleration, acceleration and deceleration. It starts at the first waypoint (Route::start()).
class RouteFollower {
 public:
  /// A point of the path to drive, evenly spaced.
  struct PathPoint {
    Eigen::Vector2d position;  ///< m, map frame
    double speed_mps;
    double stop_s;
  };

  /// Throws as require_drivable(). Requires parameters without faults.
  RouteFollower(const Route& route, const RouteFollowerParameters& parameters = {});

  /// The twist to command at `time_s`, which does not decrease from call to call; zero while parked and once finished.
  Twist2 command(const Pose2& truth, double time_s);

  /// A loop is never finished.
  bool finished() const { return finished_; }
  bool is_parked() const { return is_parked_; }
  /// Completed laps of a loop.
  int laps() const { return laps_; }
  /// Share of the present lap that is done, 0 to 1.
  double progress() const;
  /// m, of the rounded path.
  double length_m() const;
  const std::vector<PathPoint>& path() const { return path_; }

 private:
  PathPoint at(double arc_length_m) const;
  void advance_progress(const Eigen::Vector2d& position);
  void limit_speeds();
  bool park_or_finish(double time_s);

  RouteFollowerParameters parameters_;
  bool loop_;
  std::vector<PathPoint> path_;
  double spacing_m_{0.0};
  double arc_length_m_{0.0};        ///< of the robot on the present lap
  std::vector<std::size_t> stops_;  ///< indices into path_
  std::size_t next_stop_{0};        ///< index into stops_
  int laps_{0};
  bool is_parked_{false};
  double parked_until_s_{0.0};
  bool finished_{false};
};

}  // namespace urban_gnss
