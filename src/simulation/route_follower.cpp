#include <algorithm>
#include <cmath>

#include "urban_gnss_localization/simulation/route.hpp"

namespace urban_gnss {
namespace {

constexpr double kSamePlace_m = 1e-6;
constexpr double kPathSpacing_m = 0.5;  // longest distance between two points of the path
constexpr double kArcStep_rad = 0.05;
constexpr int kCurvatureReach = 3;     // points to either side over which the path's curvature is taken
constexpr double kSearch_m = 10.0;     // how far ahead of its last place on the path the robot is looked for
constexpr double kArrived_m = 0.2;     // so near to a stop, or to the end, the robot is there
constexpr double kSharpest_rad = 2.9;  // a corner that turns more is not rounded: its arc would have no length

std::vector<RouteWaypoint> without_repetitions(const Route& route) {
  std::vector<RouteWaypoint> kept;
  const auto repeats = [&](const RouteWaypoint& a, const RouteWaypoint& b) {
    return (a.position - b.position).norm() < kSamePlace_m;
  };
  for (const RouteWaypoint& waypoint : route.waypoints) {
    if (kept.empty() || !repeats(kept.back(), waypoint)) {
      kept.push_back(waypoint);
    } else {
      kept.back().speed_mps = waypoint.speed_mps;
      kept.back().stop_s += waypoint.stop_s;
    }
  }
  if (route.loop && repeats(kept.back(), kept.front())) {
    kept.front().stop_s += kept.back().stop_s;
    kept.pop_back();
  }
  return kept;
}

/// The corner at `corner` as an arc that touches both legs; its stop is in the middle.
void append_corner(const Eigen::Vector2d& before, const RouteWaypoint& corner, const Eigen::Vector2d& after,
                   double radius_m, std::vector<RouteFollower::PathPoint>& points) {
  const Eigen::Vector2d in = corner.position - before;
  const Eigen::Vector2d out = after - corner.position;
  const double turn = std::atan2(in.x() * out.y() - in.y() * out.x(), in.dot(out));
  const double half_tangent = std::tan(0.5 * std::abs(turn));
  if (std::abs(turn) < 1e-6 || std::abs(turn) > kSharpest_rad) {
    points.push_back({corner.position, corner.speed_mps, corner.stop_s});
    return;
  }
  const double tangent = std::min(radius_m * half_tangent, 0.45 * std::min(in.norm(), out.norm()));
  const double radius = tangent / half_tangent;
  const Eigen::Vector2d start = corner.position - tangent * in.normalized();
  const double heading = std::atan2(in.y(), in.x());
  const int half_steps = static_cast<int>(std::ceil(0.5 * std::abs(turn) / kArcStep_rad));
  for (int i = 0; i <= 2 * half_steps; ++i) {
    const double turned = turn * i / (2 * half_steps);
    const double chord = 2.0 * radius * std::sin(0.5 * std::abs(turned));
    const double direction = heading + 0.5 * turned;
    points.push_back({start + chord * Eigen::Vector2d(std::cos(direction), std::sin(direction)), corner.speed_mps,
                      i == half_steps ? corner.stop_s : 0.0});
  }
}

std::vector<RouteFollower::PathPoint> round_corners(const std::vector<RouteWaypoint>& waypoints, bool loop,
                                                    double radius_m) {
  std::vector<RouteFollower::PathPoint> points;
  std::vector<RouteFollower::PathPoint> lap_end;
  const std::size_t n = waypoints.size();
  for (std::size_t i = 0; i < n; ++i) {
    const RouteWaypoint& waypoint = waypoints[i];
    if (!loop && (i == 0 || i + 1 == n)) {
      points.push_back({waypoint.position, waypoint.speed_mps, waypoint.stop_s});
    } else {
      append_corner(waypoints[(i + n - 1) % n].position, waypoint, waypoints[(i + 1) % n].position, radius_m, points);
    }
    if (loop && i == 0) {
      // A lap starts and ends in the middle of the first corner.
      const auto middle = points.begin() + static_cast<std::ptrdiff_t>(points.size() / 2);
      lap_end.assign(points.begin(), middle + 1);
      lap_end.back().stop_s = 0.0;
      points.erase(points.begin(), middle);
    }
  }
  points.insert(points.end(), lap_end.begin(), lap_end.end());
  return points;
}

/// Points at equal distances along `points`, the first and the last among them. A stop goes to the nearest.
std::vector<RouteFollower::PathPoint> space_evenly(const std::vector<RouteFollower::PathPoint>& points,
                                                   double& spacing_m) {
  std::vector<double> along(points.size(), 0.0);
  for (std::size_t i = 1; i < points.size(); ++i) {
    along[i] = along[i - 1] + (points[i].position - points[i - 1].position).norm();
  }
  const double length = along.back();
  const auto steps = static_cast<std::size_t>(std::max(std::ceil(length / kPathSpacing_m), 1.0));
  spacing_m = length / static_cast<double>(steps);
  std::vector<RouteFollower::PathPoint> even;
  even.reserve(steps + 1);
  std::size_t leg = 0;
  for (std::size_t i = 0; i <= steps; ++i) {
    const double distance = spacing_m * static_cast<double>(i);
    while (leg + 2 < points.size() && along[leg + 1] <= distance) ++leg;
    const double leg_length = along[leg + 1] - along[leg];
    const double share = leg_length > 0.0 ? std::clamp((distance - along[leg]) / leg_length, 0.0, 1.0) : 0.0;
    even.push_back(
        {points[leg].position + share * (points[leg + 1].position - points[leg].position), points[leg].speed_mps, 0.0});
  }
  for (std::size_t i = 0; i < points.size(); ++i) {
    even[static_cast<std::size_t>(std::lround(along[i] / spacing_m))].stop_s += points[i].stop_s;
  }
  return even;
}

}  // namespace

RouteFollower::RouteFollower(const Route& route, const RouteFollowerParameters& parameters)
    : parameters_(parameters), loop_(route.loop) {
  require_drivable(route);
  path_ = space_evenly(round_corners(without_repetitions(route), loop_, parameters_.corner_radius), spacing_m_);
  for (std::size_t i = 0; i < path_.size(); ++i) {
    if (path_[i].stop_s > 0.0) stops_.push_back(i);
  }
  limit_speeds();
}

void RouteFollower::limit_speeds() {
  const int n = static_cast<int>(path_.size());
  // On a loop the last point is the first again.
  const auto index = [&](int i) {
    return static_cast<std::size_t>(loop_ ? ((i % (n - 1)) + n - 1) % (n - 1) : std::clamp(i, 0, n - 1));
  };
  for (int i = 0; i < n; ++i) {
    const Eigen::Vector2d in = path_[index(i)].position - path_[index(i - kCurvatureReach)].position;
    const Eigen::Vector2d out = path_[index(i + kCurvatureReach)].position - path_[index(i)].position;
    const double turn = std::abs(std::atan2(in.x() * out.y() - in.y() * out.x(), in.dot(out)));
    const double curvature = turn / (kCurvatureReach * spacing_m_);
    double& speed = path_[static_cast<std::size_t>(i)].speed_mps;
    speed = std::min(speed, std::sqrt(parameters_.max_lateral_acceleration / std::max(curvature, 1e-9)));
    speed = std::max(speed, parameters_.crawl_speed);
  }
  for (const std::size_t stop : stops_) path_[stop].speed_mps = parameters_.crawl_speed;
  if (!loop_) path_.front().speed_mps = path_.back().speed_mps = parameters_.crawl_speed;

  // Twice round a loop, so that a limit reaches back over its start.
  const int points = loop_ ? 2 * n : n;
  const auto reachable = [&](double speed, double acceleration) {
    return std::sqrt(speed * speed + 2.0 * acceleration * spacing_m_);
  };
  for (int i = points - 2; i >= 0; --i) {
    double& speed = path_[index(i)].speed_mps;
    speed = std::min(speed, reachable(path_[index(i + 1)].speed_mps, parameters_.deceleration));
  }
  for (int i = 1; i < points; ++i) {
    double& speed = path_[index(i)].speed_mps;
    speed = std::min(speed, reachable(path_[index(i - 1)].speed_mps, parameters_.acceleration));
  }
  if (loop_) path_.back().speed_mps = path_.front().speed_mps;
}

double RouteFollower::length_m() const { return spacing_m_ * static_cast<double>(path_.size() - 1); }

double RouteFollower::progress() const { return finished_ ? 1.0 : std::min(arc_length_m_ / length_m(), 1.0); }

RouteFollower::PathPoint RouteFollower::at(double arc_length_m) const {
  const double length = length_m();
  const double along =
      loop_ ? arc_length_m - length * std::floor(arc_length_m / length) : std::min(arc_length_m, length);
  const std::size_t i = std::min(static_cast<std::size_t>(along / spacing_m_), path_.size() - 2);
  const double share = along / spacing_m_ - static_cast<double>(i);
  const PathPoint& a = path_[i];
  const PathPoint& b = path_[i + 1];
  return {a.position + share * (b.position - a.position), a.speed_mps + share * (b.speed_mps - a.speed_mps), 0.0};
}

void RouteFollower::advance_progress(const Eigen::Vector2d& position) {
  // No stop may be passed over, and the path may cross itself: only a stretch ahead is searched.
  double end = arc_length_m_ + kSearch_m;
  if (next_stop_ < stops_.size()) end = std::min(end, spacing_m_ * static_cast<double>(stops_[next_stop_]));
  if (!loop_) end = std::min(end, length_m());
  double best = arc_length_m_;
  double best_distance = (at(best).position - position).norm();
  for (double start = arc_length_m_; start < end; start += spacing_m_) {
    const Eigen::Vector2d from = at(start).position;
    const Eigen::Vector2d leg = at(std::min(start + spacing_m_, end)).position - from;
    const double squared = leg.squaredNorm();
    const double share = squared > 0.0 ? std::clamp(leg.dot(position - from) / squared, 0.0, 1.0) : 0.0;
    const double distance = (from + share * leg - position).norm();
    if (distance < best_distance) {
      best = std::min(start + share * spacing_m_, end);
      best_distance = distance;
    }
  }
  arc_length_m_ = best;
  if (loop_ && arc_length_m_ >= length_m()) {
    arc_length_m_ -= length_m();
    next_stop_ = 0;
    ++laps_;
  }
}

bool RouteFollower::park_or_finish(double time_s) {
  if (is_parked_ && time_s < parked_until_s_) return true;
  is_parked_ = false;
  if (next_stop_ < stops_.size() && spacing_m_ * static_cast<double>(stops_[next_stop_]) - arc_length_m_ < kArrived_m) {
    parked_until_s_ = time_s + path_[stops_[next_stop_]].stop_s;
    is_parked_ = true;
    ++next_stop_;
    return true;
  }
  finished_ = !loop_ && length_m() - arc_length_m_ < kArrived_m;
  return finished_;
}

Twist2 RouteFollower::command(const Pose2& truth, double time_s) {
  if (finished_) return {};
  advance_progress(truth.position());
  if (park_or_finish(time_s)) return {};

  const double speed = at(arc_length_m_).speed_mps;
  const double lookahead = std::max(parameters_.min_lookahead, parameters_.lookahead_time * speed);
  Eigen::Vector2d goal = at(arc_length_m_ + lookahead).position;
  const double beyond_end = loop_ ? 0.0 : arc_length_m_ + lookahead - length_m();
  if (beyond_end > 0.0) {
    // Straight on over the end: a goal closer and closer would make the robot turn more and more.
    const PathPoint& end = path_.back();
    goal = end.position + beyond_end * (end.position - path_[path_.size() - 2].position) / spacing_m_;
  }
  // Coulter 1992, eq. 1: the arc through the robot, tangent to its heading, and the goal.
  const Eigen::Vector2d in_base = transform_point(inverse(truth), goal);
  return {speed, speed * 2.0 * in_base.y() / std::max(in_base.squaredNorm(), 1e-6)};
}

}  // namespace urban_gnss
