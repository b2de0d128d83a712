#include "urban_gnss_localization/gnss/heading_initializer.hpp"

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <sstream>
#include <stdexcept>

namespace urban_gnss {
namespace {

constexpr std::size_t kMinFixes = 4;
constexpr int kIterations = 20;             // the weights settle within a few
constexpr double kCauchyTuning = 2.3849;    // 95 % efficiency where the noise is Gaussian after all
constexpr double kRayleighMedian = 1.1774;  // median length of a 2-D vector with unit variance per axis
constexpr double kMaxOdometry_m = 1e8;      // farther than round the Earth; squares stay finite
constexpr double kAgreement = 9.2103;       // chi-square quantile, 99 %, 2 degrees of freedom

double upper_median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

double cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); }

}  // namespace

void HeadingInitializerParameters::check(std::vector<std::string>&) const {}

HeadingInitializer::HeadingInitializer(HeadingInitializerParameters parameters) : parameters_(parameters) {}

void HeadingInitializer::add(const Pose2& odometry_pose_at_fix, const LocalFix& fix) {
  const double information = 2.0 / fix.covariance.trace();
  const bool is_usable =
      is_finite(odometry_pose_at_fix) && odometry_pose_at_fix.position().lpNorm<Eigen::Infinity>() < kMaxOdometry_m &&
      fix.position.allFinite() && fix.covariance.allFinite() && std::isfinite(information) && information > 0.0;
  if (!is_usable || (!samples_.empty() && fix.stamp <= samples_.back().fix.stamp)) return;
  if (!first_stamp_) first_stamp_ = fix.stamp;
  samples_.push_back({odometry_pose_at_fix, fix, information});
  while (to_seconds(fix.stamp - samples_.front().fix.stamp) > parameters_.initialization_window) samples_.pop_front();
}

std::optional<PoseEstimate> HeadingInitializer::estimate() const {
  const auto found = consensus();
  if (!found || !is_converged(*found)) return std::nullopt;

  const Alignment& alignment = found->alignment;
  const Pose2& last = samples_.back().odometry;
  const Pose2 rotation{0.0, 0.0, alignment.yaw};
  const Eigen::Vector2d lever = transform_point(rotation, last.position() - alignment.odometry_centroid);
  const Eigen::Vector2d position = alignment.map_centroid + lever;

  // position = centroid + lever turned by the yaw, the errors of centroid and yaw being independent.
  const Eigen::Vector3d per_yaw(-lever.y(), lever.x(), 1.0);
  PoseEstimate result;
  result.pose = {position.x(), position.y(), wrap_angle(alignment.yaw + last.yaw)};
  result.covariance = found->yaw_variance * per_yaw * per_yaw.transpose();
  result.covariance.topLeftCorner<2, 2>() += found->position_variance * Eigen::Matrix2d::Identity();
  return result;
}

PoseEstimate HeadingInitializer::without_heading() const {
  if (samples_.empty()) throw std::logic_error("heading initializer: no position before the first fix");
  const auto found = consensus();
  const Sample& sample = found ? samples_[found->latest] : samples_.back();
  // In which direction the robot moved since then is unknown.
  const double moved_since = (samples_.back().odometry.position() - sample.odometry.position()).squaredNorm();

  PoseEstimate result;
  result.pose = {sample.fix.position.x(), sample.fix.position.y(), 0.0};
  result.covariance.topLeftCorner<2, 2>() = sample.fix.covariance + moved_since * Eigen::Matrix2d::Identity();
  result.covariance(2, 2) = kPi * kPi / 3.0;
  return result;
}

bool HeadingInitializer::timed_out() const {
  return first_stamp_ && !samples_.empty() &&
         to_seconds(samples_.back().fix.stamp - *first_stamp_) >= parameters_.initialization_timeout;
}

void HeadingInitializer::reset() {
  samples_.clear();
  first_stamp_.reset();
}

std::string HeadingInitializer::waiting_for() const {
  const auto found = consensus();
  std::ostringstream out;
  out << std::fixed << std::setprecision(1);
  if (!found) {
    out << "heading: fewer than " << kMinFixes << " agreeing fixes";
  } else if (distance_moved() <= 2.0 * found->noise_sigma) {
    out << "heading: moved " << distance_moved() << " of " << 2.0 * found->noise_sigma << " m";
  } else if (!is_converged(*found)) {
    out << std::setprecision(2) << "heading: sigma " << std::sqrt(found->yaw_variance) << " rad, needed "
        << parameters_.initialization_heading_sigma;
  }
  return out.str();
}

HeadingInitializer::Alignment HeadingInitializer::align(const std::vector<double>& weights) const {
  Alignment result{Eigen::Vector2d::Zero(), Eigen::Vector2d::Zero(), 0.0, 0.0, 0.0};
  for (std::size_t i = 0; i < samples_.size(); ++i) {
    result.odometry_centroid += weights[i] * samples_[i].odometry.position();
    result.map_centroid += weights[i] * samples_[i].fix.position;
    result.information += weights[i];
  }
  result.odometry_centroid /= result.information;
  result.map_centroid /= result.information;

  // In the plane the rotation that minimises the squared distances needs no decomposition.
  double cosine_sum = 0.0;
  double sine_sum = 0.0;
  for (std::size_t i = 0; i < samples_.size(); ++i) {
    const Eigen::Vector2d from = samples_[i].odometry.position() - result.odometry_centroid;
    const Eigen::Vector2d to = samples_[i].fix.position - result.map_centroid;
    cosine_sum += weights[i] * from.dot(to);
    sine_sum += weights[i] * cross(from, to);
    result.lever_information += weights[i] * from.squaredNorm();
  }
  result.yaw = std::atan2(sine_sum, cosine_sum);
  return result;
}

std::vector<double> HeadingInitializer::normalised_residuals(const Alignment& alignment) const {
  const Pose2 rotation{0.0, 0.0, alignment.yaw};
  std::vector<double> residuals;
  for (const Sample& sample : samples_) {
    const Eigen::Vector2d lever = sample.odometry.position() - alignment.odometry_centroid;
    const Eigen::Vector2d predicted = alignment.map_centroid + transform_point(rotation, lever);
    residuals.push_back((sample.fix.position - predicted).norm() * std::sqrt(sample.information));
  }
  return residuals;
}

std::optional<HeadingInitializer::Consensus> HeadingInitializer::consensus() const {
  if (samples_.size() < kMinFixes) return std::nullopt;

  std::vector<double> weights;
  for (const Sample& sample : samples_) weights.push_back(sample.information);
  std::vector<double> residuals = normalised_residuals(align(weights));
  const auto scale = [&] { return std::max(1.0, upper_median(residuals) / kRayleighMedian); };
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    const double width = kCauchyTuning * scale();
    for (std::size_t i = 0; i < samples_.size(); ++i) {
      weights[i] = samples_[i].information / (1.0 + std::pow(residuals[i] / width, 2));
    }
    residuals = normalised_residuals(align(weights));
  }

  Consensus result{};
  const double limit = std::sqrt(kAgreement) * scale();
  for (std::size_t i = 0; i < samples_.size(); ++i) {
    const bool agrees = residuals[i] <= limit;
    weights[i] = agrees ? samples_[i].information : 0.0;
    if (agrees) {
      ++result.count;
      result.latest = i;
    }
  }
  if (result.count < kMinFixes) return std::nullopt;

  result.alignment = align(weights);
  residuals = normalised_residuals(result.alignment);
  double squared_residuals = 0.0;
  for (std::size_t i = 0; i < samples_.size(); ++i) {
    if (weights[i] > 0.0) squared_residuals += residuals[i] * residuals[i];
  }
  // Two coordinates a fix, less the three of the alignment.
  const auto count = static_cast<double>(result.count);
  const double declared_too_small = std::max(1.0, squared_residuals / (2.0 * count - 3.0));
  result.noise_sigma = std::sqrt(declared_too_small * count / result.alignment.information);
  result.position_variance = declared_too_small / result.alignment.information;
  result.yaw_variance = declared_too_small / result.alignment.lever_information;
  return result;
}

double HeadingInitializer::distance_moved() const {
  double farthest = 0.0;
  for (const Sample& sample : samples_) {
    farthest = std::max(farthest, (sample.odometry.position() - samples_.front().odometry.position()).norm());
  }
  return farthest;
}

bool HeadingInitializer::is_converged(const Consensus& found) const {
  return distance_moved() > 2.0 * found.noise_sigma &&
         std::sqrt(found.yaw_variance) < parameters_.initialization_heading_sigma;
}

}  // namespace urban_gnss
