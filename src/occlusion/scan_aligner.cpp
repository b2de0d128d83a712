#include "urban_gnss_localization/occlusion/scan_aligner.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <sstream>
#include <utility>

#include "pcl_icp.hpp"
#include "urban_gnss_localization/occlusion/point_grid.hpp"

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

/// The scan as it is aligned.
struct Source {
  PointCloud points;
  Eigen::Vector3d middle{Eigen::Vector3d::Zero()};
  double lever_m{1.0};  ///< RMS distance of the points from their middle, at least 1
};

/// `count` of the points at most, evenly chosen.
PointCloud thinned(PointCloud points, std::size_t count) {
  if (points.size() <= count) return points;
  PointCloud chosen;
  for (std::size_t i = 0; i < count; ++i) chosen.push_back(points[i * points.size() / count]);
  return chosen;
}

Source source_of(PointCloud points) {
  Source source;
  source.points = std::move(points);
  const auto count = static_cast<double>(source.points.size());
  for (const Eigen::Vector3f& point : source.points) source.middle += point.cast<double>();
  source.middle /= count;
  double squares_m2 = 0.0;
  for (const Eigen::Vector3f& point : source.points) squares_m2 += (point.cast<double>() - source.middle).squaredNorm();
  source.lever_m = std::max(1.0, std::sqrt(squares_m2 / count));
  return source;
}

/// How far a point may be from the map (m) to count, and from its plane to count in full.
struct Tolerance {
  double near_m;
  double inlier_m;
};

/// That of iteration `i`, by how far the iterations have come: wide at first, that of the outcome at the end.
struct Schedule {
  const ScanAlignerParameters& parameters;

  double progress(int i) const {
    return parameters.max_iterations > 1 ? static_cast<double>(i) / (parameters.max_iterations - 1) : 1.0;
  }
  Tolerance tolerance(int i) const {
    const auto& p = parameters;
    const double shrink = std::pow(p.final_distance / p.max_distance, progress(i));
    return {p.max_distance * shrink, p.inlier_distance / p.final_distance * p.max_distance * shrink};
  }
  Tolerance final() const { return {parameters.final_distance, parameters.inlier_distance}; }
};

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

/// The step of Gauss and Newton along the axes.
Vector6 solve(const Constraints& constraints, const std::vector<int>& axes) {
  // A trace of damping: without it a direction that is not constrained would be moved in at random.
  Eigen::MatrixXd information = selected(constraints.information, axes);
  information.diagonal().array() += 1e-6 * information.trace() + 1e-9;
  Eigen::VectorXd gradient(information.rows());
  for (std::size_t k = 0; k < axes.size(); ++k) gradient[static_cast<Eigen::Index>(k)] = constraints.gradient[axes[k]];
  const Eigen::VectorXd solution = -information.ldlt().solve(gradient);
  Vector6 step = Vector6::Zero();
  for (std::size_t k = 0; k < axes.size(); ++k) step[axes[k]] = solution[static_cast<Eigen::Index>(k)];
  return step;
}

/// The pose after a step, which turns about the scan's middle.
Eigen::Isometry3d moved_by(const Vector6& step, const Eigen::Isometry3d& pose, const Source& source) {
  const Eigen::Vector3d rotation = step.head<3>() / source.lever_m;
  const Eigen::Vector3d pivot = pose * source.middle;
  const double angle = rotation.norm();
  Eigen::Isometry3d change = Eigen::Isometry3d::Identity();
  change.translate(pivot + step.tail<3>());
  if (angle > 0.0) change.rotate(Eigen::AngleAxisd(angle, rotation / angle));
  change.translate(-pivot);
  return change * pose;
}

/// The guess, moved as far as `pose` along x and y, and turned as far about z.
Eigen::Isometry3d planar_part(const Eigen::Isometry3d& pose, const Eigen::Isometry3d& guess) {
  const Eigen::Matrix3d turned = pose.linear() * guess.linear().transpose();
  const double yaw = std::atan2(turned(1, 0) - turned(0, 1), turned(0, 0) + turned(1, 1));
  Eigen::Isometry3d planar = guess;
  planar.linear() = Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()) * guess.linear();
  planar.translation().head<2>() = pose.translation().head<2>();
  return planar;
}

/// Least share of the constraint in any direction along the axes.
double conditioning_of(const Constraints& constraints, const std::vector<int>& axes) {
  const Eigen::MatrixXd information = selected(constraints.information, axes);
  const double trace = information.trace();
  if (!(trace > 0.0)) return 0.0;
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(information, Eigen::EigenvaluesOnly);
  return std::max(0.0, solver.eigenvalues()[0]) / trace;
}

Alignment refused(Alignment alignment, const Eigen::Isometry3d& guess, AlignmentDecision decision, double figure,
                  const char* relation, double limit) {
  std::ostringstream reason;
  reason << enum_name(decision) << ": " << figure << ' ' << relation << ' ' << limit;
  alignment.decision = decision;
  alignment.reason = reason.str();
  alignment.pose = guess;
  return alignment;
}

/// Accepted, or refused by the first figure that is beyond its limit.
Alignment judged(Alignment alignment, const Eigen::Isometry3d& guess, const ScanAlignerParameters& p) {
  const auto refuse = [&](AlignmentDecision decision, double figure, const char* relation, double limit) {
    return refused(alignment, guess, decision, figure, relation, limit);
  };
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
  return alignment;
}

}  // namespace

EnumNames<AlignmentMethod> enum_names(AlignmentMethod) {
  return {{"robust", AlignmentMethod::kRobust}, {"pcl_icp", AlignmentMethod::kPclIcp}};
}

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
  PointCloud points;
  PointGrid search;

  struct Plane {
    bool is_known{false};
    bool is_flat{false};
    Eigen::Vector3d center;
    Eigen::Vector3d normal;
  };

  Plane fit(std::size_t point, int neighbours) const {
    constexpr double kMaxThickness = 0.1;  // variance across, of that along the narrower axis in the plane
    std::vector<PointGrid::Neighbour> nearest;
    nearest.reserve(static_cast<std::size_t>(neighbours));
    search.nearest(points[point], static_cast<std::size_t>(neighbours), nearest);
    Plane plane;
    plane.is_known = true;
    plane.center.setZero();
    for (const auto& each : nearest) plane.center += points[each.point].cast<double>();
    plane.center /= static_cast<double>(nearest.size());
    Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
    for (const auto& each : nearest) {
      const Eigen::Vector3d offset = points[each.point].cast<double>() - plane.center;
      scatter += offset * offset.transpose();
    }
    Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver;
    solver.computeDirect(scatter);
    plane.normal = solver.eigenvectors().col(0);
    plane.is_flat = solver.eigenvalues()[0] < kMaxThickness * solver.eigenvalues()[1];
    return plane;
  }

  using Planes = std::vector<Plane>;  ///< of each point, fitted when it is first asked for

  /// The constraints of the scan at this pose.
  Constraints constrain(const Source& source, const Eigen::Isometry3d& pose, const Tolerance& tolerance,
                        const ScanAlignerParameters& p, Planes& planes) const {
    Constraints sum;
    const Eigen::Vector3d pivot = pose * source.middle;
    PointGrid::Neighbour nearest;
    for (const Eigen::Vector3f& point : source.points) {
      const Eigen::Vector3d moved = pose * point.cast<double>();
      if (!search.nearest(moved.cast<float>(), tolerance.near_m, nearest)) continue;
      const std::size_t index = nearest.point;
      Plane& plane = planes[index];
      if (!plane.is_known) plane = fit(index, p.normal_neighbours);
      if (!plane.is_flat) continue;
      ++sum.matched;
      const double residual_m = plane.normal.dot(moved - plane.center);
      if (std::abs(residual_m) <= p.inlier_distance) {
        ++sum.inliers;
        sum.squared_residuals += residual_m * residual_m;
      }
      Vector6 jacobian;
      jacobian << (moved - pivot).cross(plane.normal) / source.lever_m, plane.normal;
      const double ratio = residual_m / tolerance.inlier_m;
      const double weight = 1.0 / ((1.0 + ratio * ratio) * (1.0 + ratio * ratio));  // Geman-McClure
      sum.information += weight * jacobian * jacobian.transpose();
      sum.gradient += weight * residual_m * jacobian;
    }
    return sum;
  }

  /// Gauss and Newton with robust weights: sets pose and iterations.
  void align_robustly(const Source& source, const ScanAlignerParameters& p, Planes& planes,
                      Alignment& alignment) const {
    const std::vector<int> axes = free_axes(p.freedom);
    const Schedule schedule{p};
    for (int i = 0; i < p.max_iterations; ++i) {
      const Constraints sum = constrain(source, alignment.pose, schedule.tolerance(i), p, planes);
      if (sum.matched < kMinPoints) break;
      const Vector6 step = solve(sum, axes);
      alignment.pose = moved_by(step, alignment.pose, source);
      alignment.iterations = i + 1;
      if (step.norm() < kConverged_m && schedule.progress(i) >= 0.5) break;
    }
  }

  /// The same by PCL; leaves the pose as it is where that finds none.
  void align_by_pcl(const Source& source, const ScanAlignerParameters& p, Planes& planes, Alignment& alignment) const {
    std::vector<SurfacePoint> surface;
    for (std::size_t i = 0; i < points.size(); ++i) {
      if (!planes[i].is_known) planes[i] = fit(i, p.normal_neighbours);
      if (planes[i].is_flat) surface.push_back({points[i].cast<double>(), planes[i].normal});
    }
    const auto found = pcl_icp(surface, source.points, alignment.pose, p.max_distance, p.max_iterations);
    if (!found) return;
    alignment.iterations = found->iterations;
    alignment.pose = p.freedom == AlignmentFreedom::kFull ? found->pose : planar_part(found->pose, alignment.pose);
  }
};

ScanAligner::ScanAligner(const PointCloud& map, const ScanAlignerParameters& parameters)
    : target_(std::make_unique<Target>()), parameters_(parameters) {
  require_usable("scan aligner", parameters);
  target_->points = finite_points(map);
  target_->search = PointGrid(target_->points, parameters.final_distance);
}

ScanAligner::~ScanAligner() = default;

Alignment ScanAligner::align(const PointCloud& scan, const Eigen::Isometry3d& guess) const {
  const auto& p = parameters_;
  Alignment alignment;
  PointCloud points = finite_points(scan);
  const std::size_t fewest = std::min(points.size(), target_->points.size());
  if (fewest < kMinPoints || !guess.matrix().allFinite()) {
    return refused(alignment, guess, AlignmentDecision::kTooFewPoints, static_cast<double>(fewest), "of", kMinPoints);
  }
  const Source source = source_of(thinned(std::move(points), static_cast<std::size_t>(p.max_points)));
  Target::Planes planes(target_->points.size());
  alignment.pose = guess;
  if (p.alignment_method == AlignmentMethod::kPclIcp) {
    target_->align_by_pcl(source, p, planes, alignment);
  } else {
    target_->align_robustly(source, p, planes, alignment);
  }

  const Constraints last = target_->constrain(source, alignment.pose, Schedule{p}.final(), p, planes);
  alignment.overlap = static_cast<double>(last.matched) / static_cast<double>(source.points.size());
  if (alignment.overlap < p.min_overlap) {
    return refused(alignment, guess, AlignmentDecision::kNoOverlap, alignment.overlap, "<", p.min_overlap);
  }
  alignment.inlier_fraction = static_cast<double>(last.inliers) / static_cast<double>(last.matched);
  if (last.inliers > 0) alignment.residual_m = std::sqrt(last.squared_residuals / static_cast<double>(last.inliers));
  alignment.conditioning = conditioning_of(last, free_axes(p.freedom));
  alignment.correction_m = Eigen::Vector3d(alignment.pose * source.middle - guess * source.middle).norm();
  alignment.correction_rad = Eigen::AngleAxisd(alignment.pose.linear() * guess.linear().transpose()).angle();
  return judged(alignment, guess, p);
}

}  // namespace urban_gnss
