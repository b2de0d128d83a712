#include "urban_gnss_localization/filters/switching_particle_filter.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "urban_gnss_localization/filters/dead_reckoning.hpp"
#include "urban_gnss_localization/gnss/chi_squared.hpp"

namespace urban_gnss {
namespace {

constexpr int kFixDof = 2;
constexpr double kReportedQuantile = 0.99;
constexpr double kResamplingShare = 0.5;
/// Standard deviation of the resampling's kernel, as a share of the cluster's: its variance grows by 4 %.
constexpr double kKernel = 0.2;
constexpr std::size_t kOutlier = kContinuations;
constexpr BiasMode kModes[kContinuations] = {BiasMode::kDirect, BiasMode::kSlow, BiasMode::kFast, BiasMode::kJump};

/// The continuation where the cumulated weights exceed `target`; the last one that has any weight where rounding
/// leaves none.
template <class Weight>
std::size_t choose(Weight weight, std::size_t count, double target, double& rest) {
  std::size_t last = 0;
  rest = 0.0;
  for (std::size_t j = 0; j < count; ++j) {
    const double w = weight(j);
    if (w > 0.0 && target < w) {
      rest = target / w;
      return j;
    }
    if (w > 0.0) last = j;
    target -= w;
  }
  return last;
}

/// Logarithm of the two-dimensional Student's t density over that at its centre, for a squared distance `nis`.
double log_student(double nis, double dof) { return -0.5 * (dof + kFixDof) * std::log1p(nis / dof); }

BiasState corrected(const BiasState& predicted, const Eigen::Vector2d& difference, double noise_variance) {
  const double gain = predicted.variance / (predicted.variance + noise_variance);
  return {predicted.mean + gain * (difference - predicted.mean), (1.0 - gain) * predicted.variance};
}

}  // namespace

ParticleContinuation continue_particle(const Pose2& pose, BiasMode mode, const BiasState& bias, const SwitchingFix& fix,
                                       const ModeTransition& transition, const BiasModeParameters& parameters,
                                       double draw) {
  const Eigen::Vector2d difference = fix.position - transform_point(pose, fix.antenna_in_body);
  const auto row = transition.row(static_cast<int>(index_of(mode)));
  double weight[kContinuations + 1];
  double sum = weight[kOutlier] = parameters.outlier_density();
  for (std::size_t j = 0; j < kContinuations; ++j) {
    const BiasState predicted = predict_bias(bias, mode, kModes[j], fix.elapsed_s, parameters);
    const bool is_direct = kModes[j] == BiasMode::kDirect;
    const double variance = predicted.variance + (is_direct ? fix.direct_variance : fix.shadow_variance);
    const double nis = (difference - predicted.mean).squaredNorm() / variance;
    const double log_shape = is_direct ? log_student(nis, parameters.student_dof) : -0.5 * nis;
    const double density = std::exp(log_shape) / (2.0 * kPi * variance);
    sum += weight[j] = (1.0 - parameters.outlier_share) * row[static_cast<int>(j)] * density;
  }
  ParticleContinuation next;
  next.log_likelihood = std::log(sum);
  double rest = 0.0;
  std::size_t chosen = choose([&](std::size_t j) { return weight[j]; }, kContinuations + 1, draw * sum, rest);
  next.is_outlier = chosen == kOutlier;
  if (next.is_outlier) {
    chosen = choose([&](std::size_t j) { return row[static_cast<int>(j)]; }, kContinuations, rest, rest);
  }
  next.mode = lasting(kModes[chosen]);
  next.bias = predict_bias(bias, mode, kModes[chosen], fix.elapsed_s, parameters);
  if (!next.is_outlier && next.mode != BiasMode::kDirect) {
    next.bias = corrected(next.bias, difference, fix.shadow_variance);
  }
  return next;
}

SwitchingParticleFilter::SwitchingParticleFilter(const ParticleFilterParameters& parameters,
                                                 const MotionParameters& motion)
    : ParticleLocalizer(static_cast<std::size_t>(parameters.particle_count), parameters.cluster_cell),
      parameters_(parameters),
      motion_(motion),
      nis_threshold_(chi_squared_quantile(kReportedQuantile, kFixDof)),
      resampler_(particles_.size(), ResamplingScheme::kSystematic),
      biases_(particles_.size()),
      errors_(particles_.size()),
      noise_(parameters.noise),
      modes_before_(particles_.size()),
      is_outlier_(particles_.size()) {
  initialize({});
}

void SwitchingParticleFilter::initialize(const PoseEstimate& start) {
  if (!is_finite(start.pose) || !start.covariance.allFinite()) {
    throw std::invalid_argument("particle_filter: the pose to start from is not finite");
  }
  engine_ = make_engine(static_cast<std::uint64_t>(parameters_.seed));
  particles_.draw_gaussian(start, engine_);
  errors_.reset(parameters_.odometry);
  biases_ = BiasSet(particles_.size());
  mean_errors_ = {};
  estimate_ = start.pose;
  bias_odds_ = 1.0;
  noise_.reset();
  last_fix_s_.reset();
  moved_s_ = 0.0;
  clusters_.find(particles_);
  effective_sample_size_ = urban_gnss::effective_sample_size(particles_);
}

void SwitchingParticleFilter::move(const Twist2& twist, double duration_s) {
  if (!is_usable(twist, duration_s)) return;
  moved_s_ += duration_s;
  noise_.move(twist, duration_s);
  if (is_parked(twist)) {
    const double sigma = parameters_.odometry.parked_walk * std::sqrt(duration_s);
    if (sigma <= 0.0) return;
    for (std::size_t i = 0; i < particles_.size(); ++i) {
      particles_.x[i] += sigma * draw_normal(engine_);
      particles_.y[i] += sigma * draw_normal(engine_);
    }
    return;
  }
  errors_.walk(duration_s, parameters_.odometry);
  sample_motion(particles_, errors_, make_motion_step(twist, duration_s, motion_, parameters_.odometry), engine_);
  const double position_sigma = parameters_.odometry.position_walk * std::sqrt(duration_s);
  const double heading_sigma = parameters_.odometry.heading_walk * std::sqrt(duration_s);
  if (position_sigma > 0.0 || heading_sigma > 0.0) {
    for (std::size_t i = 0; i < particles_.size(); ++i) {
      particles_.x[i] += position_sigma * draw_normal(engine_);
      particles_.y[i] += position_sigma * draw_normal(engine_);
      particles_.yaw[i] = wrap_angle(particles_.yaw[i] + heading_sigma * draw_normal(engine_));
    }
  }
  estimate_ = urban_gnss::move(estimate_, urban_gnss::corrected(twist, mean_errors_), duration_s);
}

FixVerdict SwitchingParticleFilter::correct(const FixMeasurement& fix) {
  FixVerdict verdict;
  if (!is_usable(fix)) {
    verdict.decision = FixDecision::kRejectedNonFinite;
    verdict.reason = "position, time or covariance cannot be used";
    return verdict;
  }
  SwitchingFix seen;
  seen.position = fix.position;
  seen.antenna_in_body = fix.antenna_in_body;
  const double factor = 0.5 * noise_.scale() * noise_.correlation_inflation(fix.time_s);
  seen.direct_variance = factor * parameters_.fix.direct_covariance(fix.covariance).trace();
  seen.shadow_variance = factor * parameters_.fix.shadow_covariance(fix.covariance).trace();
  seen.elapsed_s = last_fix_s_ ? std::max(fix.time_s - *last_fix_s_, 0.0) : moved_s_;
  last_fix_s_ = fix.time_s;
  noise_.learn(fix.time_s, is_beyond_median(fix, seen.elapsed_s) ? 1.0 : 0.0);
  examine(fix, verdict);

  continue_all(seen);
  if (!particles_.normalise()) {
    verdict.decision = FixDecision::kRejectedDegenerate;
    verdict.reason = "no particle has a usable weight; weights set equal";
    return verdict;
  }
  double outliers = 0.0;
  for (std::size_t i = 0; i < particles_.size(); ++i) outliers += is_outlier_[i] * particles_.weight[i];
  verdict.decision = mode_probabilities()[0] >= 0.5 ? FixDecision::kAccepted : FixDecision::kBiasCompensated;
  if (outliers > 0.5) {
    verdict.decision = FixDecision::kInflated;
    verdict.reason = "outlier, probability " + std::to_string(outliers);
  }

  effective_sample_size_ = urban_gnss::effective_sample_size(particles_);
  update_estimate();
  if (effective_sample_size_ < kResamplingShare * static_cast<double>(particles_.size())) resample();
  return verdict;
}

void SwitchingParticleFilter::resample() {
  // Of the heaviest cluster, before its particles are equal.
  using Vector5 = Eigen::Matrix<double, kErrorStates, 1>;
  ErrorCovariance covariance = ErrorCovariance::Zero();
  double mass = 0.0;
  for (std::size_t i = 0; i < particles_.size(); ++i) {
    if (!clusters_.is_in_heaviest(i)) continue;
    Vector5 offset;
    offset << particles_.x[i] - estimate_.x, particles_.y[i] - estimate_.y,
        angle_difference(particles_.yaw[i], estimate_.yaw), errors_.speed_scale[i] - mean_errors_.speed_scale,
        errors_.yaw_rate_bias[i] - mean_errors_.yaw_rate_bias_radps;
    covariance += particles_.weight[i] * offset * offset.transpose();
    mass += particles_.weight[i];
  }

  resampler_.resample(particles_, engine_);
  for (auto* values : {&biases_.x, &biases_.y, &biases_.variance, &errors_.speed_scale, &errors_.yaw_rate_bias}) {
    resampler_.gather(*values);
  }
  const std::vector<std::uint32_t>& parents = resampler_.parents();
  for (std::size_t i = 0; i < parents.size(); ++i) modes_before_[i] = biases_.mode[parents[i]];
  biases_.mode.swap(modes_before_);

  if (!(mass > 0.0) || !covariance.allFinite()) return;
  const Eigen::SelfAdjointEigenSolver<ErrorCovariance> axes(covariance / mass);
  const ErrorCovariance root =
      kKernel * axes.eigenvectors() * axes.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal();
  for (std::size_t i = 0; i < particles_.size(); ++i) {
    Vector5 draw;
    for (int axis = 0; axis < kErrorStates; ++axis) draw[axis] = draw_normal(engine_);
    const Vector5 shift = root * draw;
    particles_.x[i] += shift[0];
    particles_.y[i] += shift[1];
    particles_.yaw[i] = wrap_angle(particles_.yaw[i] + shift[2]);
    errors_.speed_scale[i] += shift[3];
    errors_.yaw_rate_bias[i] += shift[4];
    if (biases_.mode[i] == BiasMode::kDirect) continue;
    biases_.x[i] -= shift[0];
    biases_.y[i] -= shift[1];
  }
}

void SwitchingParticleFilter::continue_all(const SwitchingFix& fix) {
  const BiasModeParameters& p = parameters_.modes;
  const ModeTransition transition = mode_transition(fix.elapsed_s, p, bias_odds_);
  const double fade = bias_fade(fix.elapsed_s, p);
  const double log_2pi = std::log(2.0 * kPi);
  const double log_outlier = std::log(p.outlier_density());  // -infinity where there are none
  Eigen::Matrix<double, kLastingModes, kContinuations> log_prior =
      transition.array().log() + (std::log1p(-p.outlier_share) - log_2pi);  // and the density's constant

  // What a continuation begins with does not depend on the particle, but for the bias that goes on.
  double noise[kContinuations];
  double begun[kLastingModes][kContinuations];      // variance of the difference
  double log_begun[kLastingModes][kContinuations];  // its logarithm
  for (std::size_t m = 0; m < kLastingModes; ++m) {
    for (std::size_t j = 0; j < kContinuations; ++j) {
      noise[j] = kModes[j] == BiasMode::kDirect ? fix.direct_variance : fix.shadow_variance;
      begun[m][j] = predict_bias({}, kModes[m], kModes[j], fix.elapsed_s, p).variance + noise[j];
      log_begun[m][j] = std::log(begun[m][j]);
    }
  }
  const bool has_lever = !fix.antenna_in_body.isZero(0.0);
  for (std::size_t i = 0; i < particles_.size(); ++i) {
    const std::size_t m = index_of(biases_.mode[i]);
    Eigen::Vector2d difference(fix.position.x() - particles_.x[i], fix.position.y() - particles_.y[i]);
    if (has_lever) difference = fix.position - transform_point(particles_.pose(i), fix.antenna_in_body);
    const Eigen::Vector2d mean(biases_.x[i], biases_.y[i]);  // 0 in the direct mode
    const double without = 0.5 * difference.squaredNorm();
    const double with = 0.5 * (difference - fade * mean).squaredNorm();
    const double variance = fade * fade * biases_.variance[i];

    double exponent[kContinuations + 1];
    double largest = exponent[kOutlier] = log_outlier;
    for (std::size_t j = 0; j < kContinuations; ++j) {
      const bool goes_on = m != 0 && (kModes[j] == BiasMode::kSlow || kModes[j] == BiasMode::kFast);
      const double s = goes_on ? variance + begun[m][j] : begun[m][j];
      const double log_s = goes_on ? std::log(s) : log_begun[m][j];
      const double shape = kModes[j] == BiasMode::kDirect ? log_student(2.0 * without / s, p.student_dof)
                                                          : -(goes_on ? with : without) / s;
      exponent[j] = log_prior(static_cast<int>(m), static_cast<int>(j)) - log_s + shape;
      largest = std::max(largest, exponent[j]);
    }
    double sum = 0.0;
    for (double& e : exponent) sum += e = std::exp(e - largest);
    particles_.log_weight[i] += largest + std::log(sum);

    double rest = 0.0;
    std::size_t chosen =
        choose([&](std::size_t j) { return exponent[j]; }, kContinuations + 1, draw_uniform(engine_) * sum, rest);
    is_outlier_[i] = chosen == kOutlier;
    if (is_outlier_[i]) {
      chosen = choose([&](std::size_t j) { return transition(static_cast<int>(m), static_cast<int>(j)); },
                      kContinuations, rest, rest);
    }
    const BiasMode to = kModes[chosen];
    BiasState next = predict_bias(biases_.bias(i), biases_.mode[i], to, fix.elapsed_s, p);
    if (!is_outlier_[i] && to != BiasMode::kDirect) next = corrected(next, difference, fix.shadow_variance);
    biases_.mode[i] = lasting(to);
    biases_.x[i] = next.mean.x();
    biases_.y[i] = next.mean.y();
    biases_.variance[i] = next.variance;
  }
}

bool SwitchingParticleFilter::is_beyond_median(const FixMeasurement& fix, double elapsed_s) const {
  const double fade = bias_fade(elapsed_s, parameters_.modes);
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  Eigen::Matrix2d square = Eigen::Matrix2d::Zero();
  for (std::size_t i = 0; i < particles_.size(); ++i) {
    Eigen::Vector2d difference = fix.position - transform_point(particles_.pose(i), fix.antenna_in_body);
    double variance = 0.0;
    if (biases_.mode[i] != BiasMode::kDirect) {
      difference -= fade * Eigen::Vector2d(biases_.x[i], biases_.y[i]);
      variance = fade * fade * biases_.variance[i] + bias_growth(biases_.mode[i], elapsed_s, parameters_.modes);
    }
    mean += particles_.weight[i] * difference;
    square += particles_.weight[i] * (difference * difference.transpose() + variance * Eigen::Matrix2d::Identity());
  }
  const Eigen::Matrix2d covariance =
      square - mean * mean.transpose() + noise_.scale() * parameters_.fix.direct_covariance(fix.covariance);
  return mean.dot(covariance.ldlt().solve(mean)) > LearntScale::kMedianNis;
}

void SwitchingParticleFilter::examine(const FixMeasurement& fix, FixVerdict& verdict) const {
  const Eigen::Matrix2d spread = covariance_about(particles_, estimate_).topLeftCorner<2, 2>();
  const Eigen::Vector2d innovation = fix.position - transform_point(estimate_, fix.antenna_in_body);
  const Eigen::Matrix2d covariance = spread + parameters_.fix.direct_covariance(fix.covariance);
  verdict.nis = innovation.dot(covariance.ldlt().solve(innovation));
  verdict.nis_dof = kFixDof;
  verdict.nis_threshold = nis_threshold_;
}

void SwitchingParticleFilter::update_estimate() {
  clusters_.find(particles_);
  estimate_ = parameters_.estimate == EstimateMethod::kHeaviestCluster ? clusters_.heaviest_mean(particles_)
                                                                       : circular_mean(particles_);
  mean_errors_ = {};
  for (std::size_t i = 0; i < particles_.size(); ++i) {
    mean_errors_.speed_scale += particles_.weight[i] * errors_.speed_scale[i];
    mean_errors_.yaw_rate_bias_radps += particles_.weight[i] * errors_.yaw_rate_bias[i];
  }
}

ModeProbabilities SwitchingParticleFilter::mode_probabilities() const {
  ModeProbabilities probabilities = ModeProbabilities::Zero();
  for (std::size_t i = 0; i < particles_.size(); ++i) {
    probabilities[static_cast<int>(index_of(biases_.mode[i]))] += particles_.weight[i];
  }
  return probabilities;
}

std::unique_ptr<ParticleLocalizer> make_particle_filter(const ParticleFilterParameters& parameters,
                                                        const MotionParameters& motion) {
  if (parameters.mode == ParticleFilterMode::kSwitching) {
    return std::make_unique<SwitchingParticleFilter>(parameters, motion);
  }
  return std::make_unique<ParticleFilter>(parameters, motion);
}

}  // namespace urban_gnss
