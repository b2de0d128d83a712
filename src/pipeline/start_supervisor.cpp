#include "urban_gnss_localization/pipeline/start_supervisor.hpp"

#include <cmath>
#include <stdexcept>
#include <utility>

#include "text.hpp"
#include "urban_gnss_localization/geometry/pose_faults.hpp"

namespace urban_gnss {
namespace {

constexpr double kFarSigmas = 3.0;
/// Of a pose that is told, standard deviations beyond it say no more.
constexpr double kFarthest_m = 1e5;
/// Fixes closer together than this share their error: for the start they count as one.
constexpr double kStartFixInterval_s = 1.0;

}  // namespace

void StartParameters::check(std::vector<std::string>& faults) const {
  if (initial_pose.empty() || initial_pose.size() == 3) return;
  faults.push_back("initial_pose: has " + std::to_string(initial_pose.size()) +
                   " numbers; must be x, y (m) and yaw (rad), or empty");
}

StartSupervisor::StartSupervisor(const StartParameters& parameters)
    : parameters_(parameters), heading_(parameters.heading) {
  const std::vector<double>& pose = parameters.initial_pose;
  if (pose.size() != 3) return;
  const double p2 = parameters.initial_position_sigma * parameters.initial_position_sigma;
  const double h2 = parameters.initial_heading_sigma * parameters.initial_heading_sigma;
  given_.emplace();
  given_->pose = {pose[0], pose[1], wrap_angle(pose[2])};
  given_->covariance = Eigen::Vector3d(p2, p2, h2).asDiagonal();
}

void StartSupervisor::give(const PoseEstimate& pose) {
  const std::string fault = estimate_fault(pose);
  if (!fault.empty()) throw std::invalid_argument(fault);
  const double p2 = parameters_.initial_position_sigma * parameters_.initial_position_sigma;
  const double h2 = parameters_.initial_heading_sigma * parameters_.initial_heading_sigma;
  const Eigen::Vector3d default_variance(p2, p2, h2);
  const Eigen::Vector3d most(kFarthest_m * kFarthest_m, kFarthest_m * kFarthest_m, kPi * kPi / 3.0);
  given_ = pose;
  Eigen::Matrix3d& covariance = given_->covariance;
  for (int axis = 0; axis < 3; ++axis) {
    const double variance = covariance(axis, axis);
    if (variance == 0.0) covariance(axis, axis) = default_variance(axis);  // its covariances are 0, too
    if (variance <= most(axis)) continue;
    const double factor = std::sqrt(most(axis) / variance);
    covariance.row(axis) *= factor;
    covariance.col(axis) *= factor;
  }
}

bool StartSupervisor::remember(const StartFix& fix) {
  if (last_remembered_ && to_seconds(fix.fix.stamp - *last_remembered_) < kStartFixInterval_s) return false;
  last_remembered_ = fix.fix.stamp;
  const Pose2 antenna{fix.antenna.x(), fix.antenna.y(), 0.0};
  heading_.add(compose(*fix.history.pose_at(fix.fix.stamp), antenna), fix.fix);
  return true;
}

std::optional<Start> StartSupervisor::find_start(const StartFix& fix) {
  if (!remember(fix)) return std::nullopt;
  if (auto start = from_motion(fix)) return start;
  if (!heading_.timed_out()) return std::nullopt;
  Start start = at_latest_odometry(heading_.without_heading(), fix);
  start.source = "fixes, heading unknown";
  start.has_heading = false;
  return start;
}

std::optional<Start> StartSupervisor::find_restart(const StartFix& fix, const Eigen::Vector2d& predicted,
                                                   bool is_contradicted, std::vector<PipelineEvent>& events) {
  const bool is_remembered = remember(fix);
  std::optional<Start> start;
  if (heading_is_unknown_ && is_remembered) start = from_motion(fix);
  if (start) {
    start->fix_use = "used for a start with heading";
    return start;
  }
  const bool is_lost = is_lost_by(fix.fix, predicted, events);
  if (!is_remembered) return std::nullopt;
  if ((is_lost && heading_.is_rigid()) || (is_contradicted && heading_.is_good())) start = from_motion(fix);
  if (start) start->fix_use = "used for a new start";
  return start;
}

std::optional<Start> StartSupervisor::from_motion(const StartFix& fix) const {
  const auto found = heading_.estimate();
  return found ? std::optional<Start>(at_latest_odometry(*found, fix)) : std::nullopt;
}

Start StartSupervisor::at_latest_odometry(PoseEstimate antenna, const StartFix& fix) {
  // The mean of the fixes is no better than their common error, which their scatter does not show.
  antenna.covariance.topLeftCorner<2, 2>() += fix.fix.covariance;
  const Pose2 since = *fix.history.motion_between(fix.fix.stamp, fix.history.latest());
  antenna.pose = compose(compose(antenna.pose, inverse(Pose2{fix.antenna.x(), fix.antenna.y(), 0.0})), since);
  Start start;
  start.estimate = antenna;
  start.source = "fixes and motion";
  return start;
}

bool StartSupervisor::is_lost_by(const LocalFix& fix, const Eigen::Vector2d& predicted,
                                 std::vector<PipelineEvent>& events) {
  const double sigma = std::sqrt(fix.covariance.trace());  // of the distance, as the receiver declares it
  if ((fix.position - predicted).norm() <= parameters_.max_bias_radius + kFarSigmas * sigma) {
    far_since_.reset();
    is_lost_ = false;
    return false;
  }
  if (!far_since_) far_since_ = fix.stamp;
  if (to_seconds(fix.stamp - *far_since_) < parameters_.lost_timeout) return false;
  if (!is_lost_) {
    events.push_back(
        {PipelineEvent::Level::kWarn,
         "lost: every fix of the last " + seconds_text(parameters_.lost_timeout) + " is farther than max_bias_radius"});
  }
  is_lost_ = true;
  return true;
}

void StartSupervisor::note(const Start& start) {
  has_started_ = true;
  heading_is_unknown_ = !start.has_heading;
  is_lost_ = false;
  far_since_.reset();
  given_.reset();
}

void StartSupervisor::lose_place() {
  is_lost_ = is_lost_ || has_started_;
  has_started_ = false;
  heading_.reset();
  last_remembered_.reset();
}

}  // namespace urban_gnss
