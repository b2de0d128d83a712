#include "urban_gnss_localization/evaluation/trajectory_errors.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <iterator>

#include "urban_gnss_localization/geometry/angles.hpp"
#include "urban_gnss_localization/geometry/ellipse.hpp"
#include "urban_gnss_localization/geometry/protection_level.hpp"

namespace urban_gnss {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

template <int N>
double normalized_error_squared(const Eigen::Matrix<double, N, 1>& error,
                                const Eigen::Matrix<double, N, N>& covariance) {
  if (!error.allFinite() || !covariance.allFinite()) return kNan;
  const Eigen::LLT<Eigen::Matrix<double, N, N>> factor(covariance);
  return factor.info() == Eigen::Success ? factor.matrixL().solve(error).squaredNorm() : kNan;
}

ErrorSample error_sample(const Pose2& truth, const TimedPose& estimate) {
  const Eigen::Vector2d offset = estimate.pose.position() - truth.position();
  ErrorSample sample;
  sample.stamp = estimate.stamp;
  sample.position_error_m = offset.norm();
  sample.heading_error_rad = angle_difference(estimate.pose.yaw, truth.yaw);
  sample.estimate = estimate.pose;
  sample.truth = truth;
  sample.position_sigma_m = urban_gnss::position_sigma_m(estimate.covariance);
  sample.nees = normalized_error_squared<3>({offset.x(), offset.y(), sample.heading_error_rad}, estimate.covariance);
  sample.position_nees = normalized_error_squared<2>(offset, estimate.covariance.topLeftCorner<2, 2>());
  return sample;
}

double share(std::size_t part, std::size_t whole) {
  return whole == 0 ? kNan : static_cast<double>(part) / static_cast<double>(whole);
}

ErrorSummary summarize_errors(const std::vector<ErrorSample>& samples, double coverage) {
  std::vector<double> distances;
  std::vector<double> headings;
  std::vector<double> nees;
  std::vector<double> position_nees;
  for (auto* values : {&distances, &headings, &nees, &position_nees}) values->reserve(samples.size());
  std::size_t inside = 0;
  std::size_t beyond = 0;
  for (const ErrorSample& sample : samples) {
    distances.push_back(sample.position_error_m);
    if (std::isfinite(sample.heading_error_rad)) headings.push_back(std::abs(sample.heading_error_rad));
    if (std::isfinite(sample.nees)) nees.push_back(sample.nees);
    if (!std::isfinite(sample.position_nees)) continue;
    position_nees.push_back(sample.position_nees);
    if (is_inside_95(sample)) ++inside;
    if (sample.position_error_m > protection_level_m(sample.position_sigma_m)) ++beyond;
  }
  const auto share_below = [&](double limit_m) {
    const auto below = std::count_if(distances.begin(), distances.end(), [&](double d) { return d < limit_m; });
    return share(static_cast<std::size_t>(below), distances.size());
  };
  ErrorSummary summary;
  summary.samples = samples.size();
  summary.coverage = coverage;
  summary.share_below_5m = share_below(5.0);
  summary.share_below_10m = share_below(10.0);
  summary.inside_95 = share(inside, position_nees.size());
  summary.beyond_protection = share(beyond, position_nees.size());
  summary.position_nees_mean = summarize(std::move(position_nees)).mean;
  summary.nees_mean = summarize(std::move(nees)).mean;
  summary.heading_rad = summarize(std::move(headings));
  summary.position_m = summarize(std::move(distances));
  return summary;
}

bool has_pose_within(const Trajectory& trajectory, Stamp stamp, Stamp distance) {
  const auto first = std::lower_bound(trajectory.begin(), trajectory.end(), stamp - distance,
                                      [](const TimedPose& pose, Stamp value) { return pose.stamp < value; });
  return first != trajectory.end() && first->stamp <= stamp + distance;
}

}  // namespace

double position_sigma_m(const Eigen::Matrix3d& covariance) {
  const Eigen::Matrix2d horizontal = covariance.topLeftCorner<2, 2>();
  if (!horizontal.allFinite()) return kNan;
  const double variance = Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(horizontal).eigenvalues().y();
  return variance >= 0.0 ? std::sqrt(variance) : kNan;
}

bool is_inside_95(const ErrorSample& sample) { return sample.position_nees <= kEllipse95; }

TrajectoryErrors errors_at_truth(const Trajectory& truth, const Trajectory& estimate, Stamp max_gap) {
  TrajectoryErrors errors;
  errors.samples.reserve(truth.size());
  for (const TimedPose& true_pose : truth) {
    const auto estimated = interpolate(estimate, true_pose.stamp, max_gap);
    if (!estimated || !is_finite(estimated->pose)) continue;
    errors.samples.push_back(error_sample(true_pose.pose, *estimated));
  }
  errors.summary = summarize_errors(errors.samples, share(errors.samples.size(), truth.size()));
  return errors;
}

TrajectoryErrors errors_at_fixes(const Trajectory& truth, const Trajectory& fixes, Stamp max_truth_gap) {
  TrajectoryErrors errors;
  Trajectory usable;
  std::copy_if(fixes.begin(), fixes.end(), std::back_inserter(usable),
               [](const TimedPose& fix) { return fix.pose.position().allFinite(); });
  for (const TimedPose& fix : usable) {
    const auto true_pose = interpolate(truth, fix.stamp, max_truth_gap);
    if (true_pose) errors.samples.push_back(error_sample(true_pose->pose, fix));
  }
  const auto covered = std::count_if(truth.begin(), truth.end(), [&](const TimedPose& true_pose) {
    return has_pose_within(usable, true_pose.stamp, std::chrono::milliseconds(500));
  });
  errors.summary = summarize_errors(errors.samples, share(static_cast<std::size_t>(covered), truth.size()));
  return errors;
}

}  // namespace urban_gnss
