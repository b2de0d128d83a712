#include "urban_gnss_localization/gnss/heading_initializer.hpp"

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <numeric>
#include <sstream>
#include <stdexcept>

#include "urban_gnss_localization/common/median.hpp"
#include "urban_gnss_localization/gnss/correlated_errors.hpp"

namespace urban_gnss {
namespace {

constexpr std::size_t kMinFixes = 4;
constexpr std::size_t kMinVelocities = 4;
constexpr double kMinSpeed_mps = 0.3;
constexpr double kVelocityCorrelation_s = 1.0;
constexpr double kMinSpeedFactor = 0.7;     // noise comes this far with 0.2 % where it says to tell the yaw to 0.2 rad
constexpr int kIterations = 20;             // the weights settle within a few
constexpr double kCauchyTuning = 2.3849;    // 95 % efficiency where the noise is Gaussian after all
constexpr double kRayleighMedian = 1.1774;  // median length of a 2-D vector with unit variance per axis
constexpr double kMaxNumber = 1e8;          // in m farther than round the Earth; squares stay finite
constexpr double kRigidShare = 0.7;         // of the fixes in the window
constexpr double kGoodFactor = 1.5;         // of the declared standard deviation
constexpr double kAgreement = 9.2103;       // chi-square quantile, 99 %, 2 degrees of freedom

/// Observations of one kind, on the way to those that agree with each other.
struct Observations {
  std::size_t minimum;              ///< fewer are none
  std::vector<double> information;  ///< 1 / the declared variance per axis
  std::vector<double> weights;
  std::vector<double> residuals;  ///< in declared standard deviations

  template <class Samples, class CovarianceOf>
  Observations(std::size_t least, const Samples& samples, const CovarianceOf& covariance_of) : minimum(least) {
    for (const auto& sample : samples) information.push_back(2.0 / covariance_of(sample).trace());
    weights = information;
    if (information.size() < minimum) leave_out();
  }

  /// `lengths` of the residuals.
  void set_residuals(std::vector<double> lengths) {
    residuals = std::move(lengths);
    for (std::size_t i = 0; i < residuals.size(); ++i) residuals[i] *= std::sqrt(information[i]);
  }
  /// Factor on the declared standard deviations, by the median residual.
  double scale() const { return residuals.empty() ? 1.0 : std::max(1.0, upper_median(residuals) / kRayleighMedian); }
  void weigh_by_cauchy() {
    if (information.size() < minimum) return;
    const double s = scale();
    for (std::size_t i = 0; i < weights.size(); ++i) {
      weights[i] = information[i] / (s * s * (1.0 + std::pow(residuals[i] / (kCauchyTuning * s), 2)));
    }
  }
  /// Gives weight to those that agree, and to none where they are too few.
  void keep_agreeing() {
    const double s = scale();
    for (std::size_t i = 0; i < weights.size(); ++i) {
      weights[i] = weights[i] > 0.0 && residuals[i] <= std::sqrt(kAgreement) * s ? information[i] / (s * s) : 0.0;
    }
    if (count() < minimum) leave_out();
  }
  void leave_out() { weights.assign(weights.size(), 0.0); }
  /// Weights by the declared variances, or by those that the residuals say where these are larger. Of two coordinates
  /// each, the estimation has taken `dof` degrees of freedom.
  void weigh_by_variance(double dof) {
    double squares = 0.0;
    for (std::size_t i = 0; i < weights.size(); ++i) squares += weights[i] > 0.0 ? residuals[i] * residuals[i] : 0.0;
    const double too_small = std::max(1.0, squares / (2.0 * static_cast<double>(count()) - dof));
    for (std::size_t i = 0; i < weights.size(); ++i) weights[i] = weights[i] > 0.0 ? information[i] / too_small : 0.0;
  }
  /// Divides the weights by `inflation` of the variance, but no further than to one observation's.
  void inflate(double inflation) {
    const double limit = std::max(1.0, static_cast<double>(count()));
    for (double& weight : weights) weight /= std::min(limit, inflation);
  }
  double total_weight() const { return std::accumulate(weights.begin(), weights.end(), 0.0); }
  /// Of those that have weight.
  double total_information() const {
    double sum = 0.0;
    for (std::size_t i = 0; i < weights.size(); ++i) sum += weights[i] > 0.0 ? information[i] : 0.0;
    return sum;
  }
  std::size_t count() const {
    return static_cast<std::size_t>(std::count_if(weights.begin(), weights.end(), [](double w) { return w > 0.0; }));
  }
};

/// Whether a covariance can be a weight.
bool is_variance(const Eigen::Matrix2d& covariance) {
  const double information = 2.0 / covariance.trace();
  return covariance.allFinite() && std::isfinite(information) && information > 0.0;
}

double cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); }

}  // namespace

void HeadingInitializerParameters::check(std::vector<std::string>&) const {}

HeadingInitializer::HeadingInitializer(HeadingInitializerParameters parameters) : parameters_(parameters) {}

void HeadingInitializer::add(const Pose2& odometry_pose_at_fix, const LocalFix& fix) {
  const bool is_usable = is_finite(odometry_pose_at_fix) &&
                         odometry_pose_at_fix.position().lpNorm<Eigen::Infinity>() < kMaxNumber &&
                         fix.position.allFinite() && is_variance(fix.covariance);
  if (!is_usable || (!samples_.empty() && fix.stamp <= samples_.back().fix.stamp)) return;
  if (!first_stamp_) first_stamp_ = fix.stamp;
  samples_.push_back({odometry_pose_at_fix, fix});
  const auto is_forgotten = [&](Stamp stamp) {
    return to_seconds(fix.stamp - stamp) > parameters_.initialization_window;
  };
  while (is_forgotten(samples_.front().fix.stamp)) samples_.pop_front();
  while (!velocities_.empty() && is_forgotten(velocities_.front().stamp)) velocities_.pop_front();
}

void HeadingInitializer::add_velocity(const VelocityPair& pair) {
  const double speed_mps = pair.odometry.norm();
  const bool is_usable = std::isfinite(speed_mps) && speed_mps >= kMinSpeed_mps && speed_mps < kMaxNumber &&
                         pair.measured.norm() < kMaxNumber && is_variance(pair.covariance);
  if (!is_usable || (!velocities_.empty() && pair.stamp <= velocities_.back().stamp)) return;
  velocities_.push_back(pair);
  while (to_seconds(pair.stamp - velocities_.front().stamp) > parameters_.initialization_window)
    velocities_.pop_front();
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

bool HeadingInitializer::is_rigid() const {
  const auto found = consensus();
  return found && found->agreeing >= kRigidShare;
}

bool HeadingInitializer::is_good() const {
  const auto found = consensus();
  return found && found->agreeing >= kRigidShare && found->noise_sigma <= kGoodFactor * found->declared_sigma;
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
  velocities_.clear();
  first_stamp_.reset();
}

std::string HeadingInitializer::waiting_for() const {
  const auto found = consensus();
  std::ostringstream out;
  out << std::fixed << std::setprecision(1);
  if (!found) {
    out << "heading: fewer than " << kMinFixes << " agreeing fixes";
  } else if (distance_moved() <= 2.0 * found->noise_sigma && !is_known_by_velocities(*found)) {
    out << "heading: moved " << distance_moved() << " of " << 2.0 * found->noise_sigma << " m";
  } else if (!is_converged(*found)) {
    out << std::setprecision(2) << "heading: sigma " << std::sqrt(found->yaw_variance) << " rad, needed "
        << parameters_.initialization_heading_sigma;
  }
  return out.str();
}

HeadingInitializer::Alignment HeadingInitializer::align(const std::vector<double>& fix_weights,
                                                        const std::vector<double>& velocity_weights) const {
  Alignment result{Eigen::Vector2d::Zero(), Eigen::Vector2d::Zero(), 0.0, 0.0, 0.0, 0.0, 0.0};
  for (std::size_t i = 0; i < samples_.size(); ++i) {
    result.odometry_centroid += fix_weights[i] * samples_[i].odometry.position();
    result.map_centroid += fix_weights[i] * samples_[i].fix.position;
    result.information += fix_weights[i];
  }
  result.odometry_centroid /= result.information;
  result.map_centroid /= result.information;

  // In the plane the rotation that minimises the squared distances needs no decomposition.
  double cosine_sum = 0.0;
  double sine_sum = 0.0;
  const auto add = [&](const Eigen::Vector2d& from, const Eigen::Vector2d& to, double weight, double& information) {
    cosine_sum += weight * from.dot(to);
    sine_sum += weight * cross(from, to);
    information += weight * from.squaredNorm();
  };
  for (std::size_t i = 0; i < samples_.size(); ++i) {
    add(samples_[i].odometry.position() - result.odometry_centroid, samples_[i].fix.position - result.map_centroid,
        fix_weights[i], result.lever_information);
  }
  for (std::size_t i = 0; i < velocities_.size(); ++i) {
    add(velocities_[i].odometry, velocities_[i].measured, velocity_weights[i], result.velocity_information);
  }
  result.yaw = std::atan2(sine_sum, cosine_sum);
  if (result.velocity_information > 0.0) {
    double along = 0.0;
    for (std::size_t i = 0; i < velocities_.size(); ++i) {
      along += velocity_weights[i] *
               velocities_[i].measured.dot(transform_point({0.0, 0.0, result.yaw}, velocities_[i].odometry));
    }
    result.speed_factor = along / result.velocity_information;
  }
  return result;
}

std::vector<double> HeadingInitializer::fix_residuals(const Alignment& alignment) const {
  const Pose2 rotation{0.0, 0.0, alignment.yaw};
  std::vector<double> residuals;
  for (const Sample& sample : samples_) {
    const Eigen::Vector2d lever = sample.odometry.position() - alignment.odometry_centroid;
    const Eigen::Vector2d predicted = alignment.map_centroid + transform_point(rotation, lever);
    residuals.push_back((sample.fix.position - predicted).norm());
  }
  return residuals;
}

std::vector<double> HeadingInitializer::velocity_residuals(const Alignment& alignment) const {
  const Pose2 rotation{0.0, 0.0, alignment.yaw};
  std::vector<double> residuals;
  for (const VelocityPair& pair : velocities_) {
    residuals.push_back((pair.measured - transform_point(rotation, pair.odometry)).norm());
  }
  return residuals;
}

std::optional<HeadingInitializer::Consensus> HeadingInitializer::consensus() const {
  if (samples_.size() < kMinFixes) return std::nullopt;

  Observations fixes(kMinFixes, samples_, [](const Sample& sample) { return sample.fix.covariance; });
  Observations velocities(kMinVelocities, velocities_, [](const VelocityPair& pair) { return pair.covariance; });
  Consensus result{};
  const auto align_all = [&] {
    result.alignment = align(fixes.weights, velocities.weights);
    fixes.set_residuals(fix_residuals(result.alignment));
    velocities.set_residuals(velocity_residuals(result.alignment));
  };
  align_all();
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    fixes.weigh_by_cauchy();
    velocities.weigh_by_cauchy();
    align_all();
  }
  fixes.keep_agreeing();
  velocities.keep_agreeing();
  if (fixes.count() == 0) return std::nullopt;
  align_all();
  result.declared_sigma = std::sqrt(static_cast<double>(fixes.count()) / fixes.total_information());
  result.agreeing = static_cast<double>(fixes.count()) / static_cast<double>(samples_.size());
  fixes.weigh_by_variance(3.0);
  result.noise_sigma = std::sqrt(static_cast<double>(fixes.count()) / fixes.total_weight());
  fixes.inflate(fix_inflation());
  velocities.weigh_by_variance(1.0);
  align_all();
  if (result.alignment.speed_factor < kMinSpeedFactor) {
    velocities.leave_out();
  } else {
    velocities.inflate(velocity_inflation());
  }
  align_all();

  for (std::size_t i = 0; i < samples_.size(); ++i) {
    if (fixes.weights[i] > 0.0) result.latest = i;
  }
  const Alignment& alignment = result.alignment;
  result.position_variance = 1.0 / alignment.information;
  const double walk = odometry_yaw_variance();
  result.yaw_variance = 1.0 / (alignment.lever_information + alignment.velocity_information) + walk;
  result.velocity_yaw_variance = 1.0 / alignment.velocity_information + walk;
  return result;
}

double HeadingInitializer::velocity_inflation() const {
  if (velocities_.size() < 2) return 1.0;
  const double span_s = to_seconds(velocities_.back().stamp - velocities_.front().stamp);
  return markov_inflation(span_s / static_cast<double>(velocities_.size() - 1), kVelocityCorrelation_s);
}

double HeadingInitializer::fix_inflation() const {
  double way_m = 0.0;
  for (std::size_t i = 1; i < samples_.size(); ++i) {
    way_m += (samples_[i].odometry.position() - samples_[i - 1].odometry.position()).norm();
  }
  const double steps = static_cast<double>(samples_.size()) - 1.0;
  const double span_s = to_seconds(samples_.back().fix.stamp - samples_.front().fix.stamp);
  return steps > 0.0 ? parameters_.fix_errors.inflation(way_m / steps, span_s / steps) : 1.0;
}

double HeadingInitializer::odometry_yaw_variance() const {
  // Of a random walk over the window, its end relative to its mean: a third of its whole variance.
  const double span_s = to_seconds(samples_.back().fix.stamp - samples_.front().fix.stamp);
  return parameters_.initialization_heading_walk * parameters_.initialization_heading_walk * span_s / 3.0;
}

double HeadingInitializer::distance_moved() const {
  double farthest = 0.0;
  for (const Sample& sample : samples_) {
    farthest = std::max(farthest, (sample.odometry.position() - samples_.front().odometry.position()).norm());
  }
  return farthest;
}

bool HeadingInitializer::is_known_by_velocities(const Consensus& found) const {
  return std::sqrt(found.velocity_yaw_variance) < parameters_.initialization_heading_sigma;
}

bool HeadingInitializer::is_converged(const Consensus& found) const {
  return (distance_moved() > 2.0 * found.noise_sigma || is_known_by_velocities(found)) &&
         std::sqrt(found.yaw_variance) < parameters_.initialization_heading_sigma;
}

}  // namespace urban_gnss
