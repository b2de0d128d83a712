#include "urban_gnss_localization/occlusion/scan_aligner.hpp"

#include <pcl/kdtree/kdtree_flann.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <sstream>

#include "pcl_cloud.hpp"

namespace urban_gnss {
namespace {

constexpr std::size_t kMinPoints = 50;

/// A step smaller than this ends the iteration: m, and m at a distance of lever_m.
constexpr double kConverged_m = 1e-3;

using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Vector6 = Eigen::Matrix<double, 6, 1>;

/// The normal equations of one iteration, about the scan's middle; rotations are in units of 1/lever, so that all six
/// are metres. Order: rotation x y z, translation x y z.
struct Constraints {
  Matrix6 information{Matrix6::Zero()};
  Vector6 gradient{Vector6::Zero()};
  std::size_t matched{0};  ///< near a flat piece of the map
  std::size_t inliers{0};
  double squared_residuals{0.0};  ///< m^2, of the inliers
};

/// Which of the six may change.
std::vector<int> free_axes(AlignmentFreedom freedom) {
  if (freedom == AlignmentFreedom::kPlanar) return {2, 3, 4};
  return {0, 1, 2, 3, 4, 5};
}

Eigen::MatrixXd selected(const Matrix6& matrix, const std::vector<int>& axes) {
  const auto size = static_cast<Eigen::Index>(axes.size());
  Eigen::MatrixXd result(size, size);
  for (Eigen::Index r = 0; r < size; ++r) {
    for (Eigen::Index c = 0; c < size; ++c) {
      result(r, c) = matrix(axes[static_cast<std::size_t>(r)], axes[static_cast<std::size_t>(c)]);
    }
  }
  return result;
}

}  // namespace

EnumNames<AlignmentFreedom> enum_names(AlignmentFreedom) {
  return {{"planar", AlignmentFreedom::kPlanar}, {"full", AlignmentFreedom::kFull}};
}

EnumNames<AlignmentDecision> enum_names(AlignmentDecision) {
  return {{"accepted", AlignmentDecision::kAccepted},
          {"not_tried", AlignmentDecision::kNotTried},
          {"too_few_points", AlignmentDecision::kTooFewPoints},
          {"no_overlap", AlignmentDecision::kNoOverlap},
          {"degenerate", AlignmentDecision::kDegenerate},
          {"too_few_inliers", AlignmentDecision::kTooFewInliers},
          {"large_residual", AlignmentDecision::kLargeResidual},
          {"large_correction", AlignmentDecision::kLargeCorrection}};
}

void ScanAlignerParameters::check(std::vector<std::string>& faults) const {
  if (final_distance > max_distance) faults.push_back("final_distance: must not exceed max_distance");
  if (inlier_distance > final_distance) faults.push_back("inlier_distance: must not exceed final_distance");
}

struct ScanAligner::Target {
  pcl::KdTreeFLANN<pcl::PointXYZ> search;
  PointCloud points;

  struct Plane {
    bool is_known{false};
    bool is_flat{false};
    Eigen::Vector3d center;
    Eigen::Vector3d normal;
  };

  Plane fit(std::size_t point, int neighbours) const {
    constexpr double kMaxThickness = 0.1;  // variance across, of that along the narrower axis in the plane
    std::vector<int> indices;
    std::vector<float> squared;
    search.nearestKSearch(pcl::PointXYZ(points[point].x(), points[point].y(), points[point].z()), neighbours, indices,
                          squared);
    Plane plane;
    plane.is_known = true;
    plane.center.setZero();
    for (const int i : indices) plane.center += points[static_cast<std::size_t>(i)].cast<double>();
    plane.center /= static_cast<double>(indices.size());
    Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
    for (const int i : indices) {
      const Eigen::Vector3d offset = points[static_cast<std::size_t>(i)].cast<double>() - plane.center;
      scatter += offset * offset.transpose();
    }
    Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver;
    solver.computeDirect(scatter);
    plane.normal = solver.eigenvectors().col(0);
    plane.is_flat = solver.eigenvalues()[0] < kMaxThickness * solver.eigenvalues()[1];
    return plane;
  }
};

ScanAligner::ScanAligner(const PointCloud& map, const ScanAlignerParameters& parameters)
    : target_(std::make_unique<Target>()), parameters_(parameters) {
  require_usable("scan aligner", parameters);
  target_->points = finite_points(map);
  if (!target_->points.empty()) target_->search.setInputCloud(to_pcl(target_->points));
}

ScanAligner::~ScanAligner() = default;

Alignment ScanAligner::align(const PointCloud& scan, const Eigen::Isometry3d& guess) const {
  const auto& p = parameters_;
  Alignment alignment;
  alignment.pose = guess;
  const auto refuse = [&](AlignmentDecision decision, double figure, const char* relation, double limit) {
    std::ostringstream reason;
    reason << enum_name(decision) << ": " << figure << ' ' << relation << ' ' << limit;
    alignment.decision = decision;
    alignment.reason = reason.str();
    alignment.pose = guess;
    return alignment;
  };

  PointCloud source = finite_points(scan);
  const std::size_t fewest = std::min(source.size(), target_->points.size());
  if (fewest < kMinPoints || !guess.matrix().allFinite()) {
    return refuse(AlignmentDecision::kTooFewPoints, static_cast<double>(fewest), "of", kMinPoints);
  }
  const auto wanted = static_cast<std::size_t>(p.max_points);
  if (source.size() > wanted) {
    PointCloud chosen;
    for (std::size_t i = 0; i < wanted; ++i) chosen.push_back(source[i * source.size() / wanted]);
    source = std::move(chosen);
  }
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3f& point : source) middle += point.cast<double>();
  middle /= static_cast<double>(source.size());
  double lever_m = 0.0;
  for (const Eigen::Vector3f& point : source) lever_m += (point.cast<double>() - middle).squaredNorm();
  lever_m = std::max(1.0, std::sqrt(lever_m / static_cast<double>(source.size())));

  std::vector<Target::Plane> planes(target_->points.size());
  const auto constrain = [&](const Eigen::Isometry3d& pose, double near_m, double inlier_m) {
    Constraints sum;
    const Eigen::Vector3d pivot = pose * middle;
    std::vector<int> nearest(1);
    std::vector<float> squared(1);
    for (const Eigen::Vector3f& point : source) {
      const Eigen::Vector3d moved = pose * point.cast<double>();
      const Eigen::Vector3f single = moved.cast<float>();
      if (target_->search.nearestKSearch(pcl::PointXYZ(single.x(), single.y(), single.z()), 1, nearest, squared) != 1 ||
          squared[0] > near_m * near_m) {
        continue;
      }
      const auto index = static_cast<std::size_t>(nearest[0]);
      Target::Plane& plane = planes[index];
      if (!plane.is_known) plane = target_->fit(index, p.normal_neighbours);
      if (!plane.is_flat) continue;
      ++sum.matched;
      const double residual_m = plane.normal.dot(moved - plane.center);
      if (std::abs(residual_m) <= p.inlier_distance) {
        ++sum.inliers;
        sum.squared_residuals += residual_m * residual_m;
      }
      Vector6 jacobian;
      jacobian << (moved - pivot).cross(plane.normal) / lever_m, plane.normal;
      const double ratio = residual_m / inlier_m;
      const double weight = 1.0 / ((1.0 + ratio * ratio) * (1.0 + ratio * ratio));  // Geman-McClure
      sum.information += weight * jacobian * jacobian.transpose();
      sum.gradient += weight * residual_m * jacobian;
    }
    return sum;
  };

  const std::vector<int> axes = free_axes(p.freedom);
  Eigen::Isometry3d pose = guess;
  for (int i = 0; i < p.max_iterations; ++i) {
    const double progress = p.max_iterations > 1 ? static_cast<double>(i) / (p.max_iterations - 1) : 1.0;
    const double shrink = std::pow(p.final_distance / p.max_distance, progress);
    const Constraints sum =
        constrain(pose, p.max_distance * shrink, p.inlier_distance / p.final_distance * p.max_distance * shrink);
    if (sum.matched < kMinPoints) break;
    // A trace of damping: without it a direction that is not constrained would be moved in at random.
    Eigen::MatrixXd information = selected(sum.information, axes);
    information.diagonal().array() += 1e-6 * information.trace() + 1e-9;
    Eigen::VectorXd gradient(information.rows());
    for (std::size_t k = 0; k < axes.size(); ++k) gradient[static_cast<Eigen::Index>(k)] = sum.gradient[axes[k]];
    const Eigen::VectorXd solution = -information.ldlt().solve(gradient);
    Vector6 step = Vector6::Zero();
    for (std::size_t k = 0; k < axes.size(); ++k) step[axes[k]] = solution[static_cast<Eigen::Index>(k)];
    const Eigen::Vector3d rotation = step.head<3>() / lever_m;
    const Eigen::Vector3d pivot = pose * middle;
    const double angle = rotation.norm();
    Eigen::Isometry3d change = Eigen::Isometry3d::Identity();
    change.translate(pivot + step.tail<3>());
    if (angle > 0.0) change.rotate(Eigen::AngleAxisd(angle, rotation / angle));
    change.translate(-pivot);
    pose = change * pose;
    alignment.iterations = i + 1;
    if (step.norm() < kConverged_m && progress >= 0.5) break;
  }

  const Constraints verdict = constrain(pose, p.final_distance, p.inlier_distance);
  const auto points = static_cast<double>(source.size());
  alignment.overlap = static_cast<double>(verdict.matched) / points;
  if (alignment.overlap < p.min_overlap) {
    return refuse(AlignmentDecision::kNoOverlap, alignment.overlap, "<", p.min_overlap);
  }
  alignment.inlier_fraction = static_cast<double>(verdict.inliers) / static_cast<double>(verdict.matched);
  if (verdict.inliers > 0) {
    alignment.residual_m = std::sqrt(verdict.squared_residuals / static_cast<double>(verdict.inliers));
  }
  const Eigen::MatrixXd information = selected(verdict.information, axes);
  const double trace = information.trace();
  if (trace > 0.0) {
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(information, Eigen::EigenvaluesOnly);
    alignment.conditioning = std::max(0.0, solver.eigenvalues()[0]) / trace;
  }
  const Eigen::Vector3d moved_m = pose * middle - guess * middle;
  alignment.correction_m = moved_m.norm();
  alignment.correction_rad = Eigen::AngleAxisd(pose.linear() * guess.linear().transpose()).angle();
  if (alignment.conditioning < p.min_conditioning) {
    return refuse(AlignmentDecision::kDegenerate, alignment.conditioning, "<", p.min_conditioning);
  }
  if (alignment.inlier_fraction < p.min_inlier_fraction) {
    return refuse(AlignmentDecision::kTooFewInliers, alignment.inlier_fraction, "<", p.min_inlier_fraction);
  }
  if (alignment.residual_m > p.max_residual) {
    return refuse(AlignmentDecision::kLargeResidual, alignment.residual_m, ">", p.max_residual);
  }
  if (alignment.correction_m > p.max_correction) {
    return refuse(AlignmentDecision::kLargeCorrection, alignment.correction_m, "m >", p.max_correction);
  }
  if (alignment.correction_rad > p.max_correction_angle) {
    return refuse(AlignmentDecision::kLargeCorrection, alignment.correction_rad, "rad >", p.max_correction_angle);
  }
  alignment.decision = AlignmentDecision::kAccepted;
  alignment.pose = pose;
  return alignment;
}

}  // namespace urban_gnss
