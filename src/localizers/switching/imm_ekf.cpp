#include "urban_gnss_localization/localizers/switching/imm_ekf.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "urban_gnss_localization/gnss/chi_squared.hpp"

namespace urban_gnss {
namespace {

constexpr int kYaw = 2;
/// Of direct reception's normalised innovation, for the outcome alone.
constexpr double kReportedQuantile = 0.99;

using Gaussian = ImmEkf::Gaussian;

}  // namespace

ImmEkf::ImmEkf(const ImmEkfParameters& parameters, const MotionParameters& motion)
    : parameters_(parameters),
      motion_(motion),
      nis_threshold_(chi_squared_quantile(kReportedQuantile, kFixDof)),
      statistics_(parameters),
      levels_(quality_levels(parameters.odometry, parameters.quality)) {
  initialize({});
}

void ImmEkf::initialize(const PoseEstimate& start) {
  if (!is_finite(start.pose)) throw std::invalid_argument("imm_ekf: the pose to start from is not finite");
  if (!start.covariance.allFinite()) throw std::invalid_argument("imm_ekf: the covariance to start from is not finite");
  const Gaussian first = start_gaussian(start, parameters_);
  for (BiasQuad& quad : filters_) {
    for (std::size_t m = 0; m < kLastingModes; ++m) quad.set(m, first);
  }
  for (ModeNumbers& modes : probability_) modes = {1.0};
  set_quality(prior_quality(parameters_.quality));
  statistics_.reset();
}

void ImmEkf::move(const Twist2& twist, double duration_s) {
  if (!is_usable(twist, duration_s)) return;
  statistics_.move(twist, duration_s);
  predict(filters_, make_motion_steps(twist, duration_s, motion_, levels_), levels_);
}

void ImmEkf::doubt(const MotionDoubt& doubt) {
  for (BiasQuad& quad : filters_) {
    for (std::size_t m = 0; m < kLastingModes; ++m) {
      for (int i = 0; i < kYaw; ++i) quad.covariance[BiasQuad::pair(i, i)][m] += doubt.position_m2;
      quad.covariance[BiasQuad::pair(kYaw, kYaw)][m] += doubt.heading_rad2;
    }
  }
}

ImmEkf::Branches ImmEkf::branch(const FixMeasurement& fix) const {
  const double elapsed_s = statistics_.elapsed_s(fix.time_s);
  const ModeTransition transition = mode_transition(elapsed_s, parameters_.modes, statistics_.bias_odds());
  const QualityTransition quality = quality_transition(elapsed_s, parameters_.quality);
  const BiasSteps steps = bias_steps(elapsed_s, parameters_.modes);
  Branches branches;
  branches.expected_quality = quality.transpose() * quality_probabilities();
  for (std::size_t to = 0; to < kQualityLevels; ++to) {
    // First the qualities, of each mode for itself: how a bias goes on from there does not depend on them.
    QualityNumbers qualities;
    for (std::size_t from = 0; from < kQualityLevels; ++from) {
      const double share = quality(static_cast<int>(from), static_cast<int>(to));
      for (std::size_t m = 0; m < kContinuations; ++m) qualities[from][m] = share * probability_[from][m];
    }
    BiasQuad mixed;
    const ModeNumbers before = mix_qualities(filters_, qualities, to, mixed);
    std::array<ModeNumbers, kLastingModes> modes;
    for (std::size_t m = 0; m < kLastingModes; ++m) {
      for (std::size_t j = 0; j < kContinuations; ++j) {
        modes[m][j] = before[m] * transition(static_cast<int>(m), static_cast<int>(j));
      }
    }
    branches.probability[to] = continue_biases(mixed, modes, steps, branches.filters[to]);
  }
  branches.updates = take_fix(branches.filters, fix, statistics_.fix_noise(fix.time_s), parameters_);
  double largest = -std::numeric_limits<double>::infinity();
  for (std::size_t level = 0; level < kQualityLevels; ++level) {
    for (std::size_t j = 0; j < kContinuations; ++j) {
      if (branches.probability[level][j] > 0.0) {
        largest = std::max(largest, branches.updates[level].log_likelihood[j]);
      }
    }
  }
  branches.are_finite = are_finite(branches.filters) && std::isfinite(largest);
  weigh(branches.probability, branches.updates, largest);
  return branches;
}

void ImmEkf::merge(const Branches& branches) {
  constexpr std::size_t kDirect = index_of(BiasMode::kDirect);
  constexpr std::size_t kSlow = index_of(BiasMode::kSlow);
  constexpr std::size_t kFast = index_of(BiasMode::kFast);
  constexpr std::size_t kJump = index_of(BiasMode::kJump);
  for (std::size_t level = 0; level < kQualityLevels; ++level) {
    const ModeNumbers& p = branches.probability[level];
    const double slow = p[kSlow] + p[kJump];
    const double share = slow > 0.0 ? p[kSlow] / slow : 1.0;
    merge_jump(branches.filters[level], share, 1.0 - share, filters_[level]);
    probability_[level] = {p[kDirect], slow, p[kFast]};
  }
}

FixOutcome ImmEkf::correct(const FixMeasurement& declared) {
  FixOutcome outcome;
  if (!is_usable(declared)) {
    outcome.decision = FixDecision::kRejectedNonFinite;
    outcome.reason = "position, time or covariance cannot be used";
    return outcome;
  }
  const PoseEstimate before = pose_estimate_of(filters_, probability_);
  const FixMeasurement fix = statistics_.effective_fix(declared, before);
  const Branches branches = branch(fix);
  outcome.of_ranges = statistics_.of_ranges();
  outcome.nis = branches.updates[0].nis[index_of(BiasMode::kDirect)];
  outcome.nis_dof = kFixDof;
  outcome.nis_threshold = nis_threshold_;
  if (!branches.are_finite) {
    outcome.decision = FixDecision::kRejectedDegenerate;
    outcome.reason = "the update is not finite";
    return outcome;
  }
  double any_outlier = 0.0;
  double exceeding = 0.0;
  for (std::size_t level = 0; level < kQualityLevels; ++level) {
    for (std::size_t j = 0; j < kContinuations; ++j) {
      any_outlier += branches.probability[level][j] * branches.updates[level].outlier[j];
      if (branches.updates[level].white_nis[j] > LearntScale::kMedianNis) exceeding += branches.probability[level][j];
    }
  }
  statistics_.learn_fix(fix.time_s, exceeding);
  merge(branches);
  set_quality(bounded_quality(branches.expected_quality, quality_probabilities(), parameters_.quality));
  statistics_.compare_with_odometry(fix, before, pose());

  outcome.decision = mode_probabilities()[0] >= 0.5 ? FixDecision::kAccepted : FixDecision::kBiasCompensated;
  if (any_outlier > 0.5) {
    outcome.decision = FixDecision::kInflated;
    outcome.reason = "outlier, probability " + std::to_string(any_outlier);
  }
  return outcome;
}

void ImmEkf::correct_velocity(const VelocityMeasurement& measured) {
  if (!is_usable(measured)) return;
  const Eigen::Matrix2d noise = statistics_.velocity_scale() * measured.covariance;
  const double inflation = statistics_.velocity_inflation(measured.time_s);
  BiasQuads next = filters_;
  const BiasQuadUpdates updates = take_velocity(next, measured, noise, inflation, parameters_.velocity.velocity_dof);
  double exceeding = 0.0;
  double largest = -std::numeric_limits<double>::infinity();
  for (std::size_t level = 0; level < kQualityLevels; ++level) {
    for (std::size_t m = 0; m < kLastingModes; ++m) {
      if (updates[level].white_nis[m] > LearntScale::kMedianNis) exceeding += probability_[level][m];
      if (probability_[level][m] > 0.0) largest = std::max(largest, updates[level].log_likelihood[m]);
    }
  }
  if (!are_finite(next) || !std::isfinite(largest)) return;
  const Pose2 before = pose();
  const QualityProbabilities quality = quality_probabilities();
  filters_ = next;
  weigh(probability_, updates, largest);
  set_quality(quality);  // errors of velocities last, and look like a heading that wanders
  statistics_.learn_velocity(measured.time_s, exceeding, before, pose());
}

Gaussian ImmEkf::mixture() const { return mixture_of(filters_, probability_); }

Gaussian ImmEkf::given(BiasMode mode) const {
  const std::size_t m = index_of(lasting(mode));
  QualityNumbers weights{};
  double sum = 0.0;
  for (std::size_t level = 0; level < kQualityLevels; ++level) sum += weights[level][m] = probability_[level][m];
  if (!(sum > 0.0)) return filters_[0].at(m);
  for (ModeNumbers& modes : weights) modes[m] /= sum;
  return mixture_of(filters_, weights);
}

ModeProbabilities ImmEkf::mode_probabilities() const {
  ModeProbabilities sums = ModeProbabilities::Zero();
  for (const ModeNumbers& modes : probability_) {
    for (std::size_t m = 0; m < kLastingModes; ++m) sums[static_cast<int>(m)] += modes[m];
  }
  return sums;
}

void ImmEkf::set_quality(const QualityProbabilities& target) {
  const QualityProbabilities factors = rescaling(quality_probabilities(), target);
  for (std::size_t level = 0; level < kQualityLevels; ++level) {
    for (double& p : probability_[level]) p *= factors[static_cast<int>(level)];
  }
}

QualityProbabilities ImmEkf::quality_probabilities() const {
  QualityProbabilities sums = QualityProbabilities::Zero();
  for (std::size_t level = 0; level < kQualityLevels; ++level) {
    for (const double p : probability_[level]) sums[static_cast<int>(level)] += p;
  }
  return sums;
}

Pose2 ImmEkf::pose() const { return pose_of(filters_, probability_); }

PoseEstimate ImmEkf::estimate() const {
  PoseEstimate estimate = pose_estimate_of(filters_, probability_);
  estimate.covariance.diagonal().head<2>().array() += statistics_.common_variance_m2();
  return estimate;
}

LocalizerHealth ImmEkf::health() const {
  const Eigen::Matrix3d covariance = pose_estimate_of(filters_, probability_).covariance;
  LocalizerHealth health;
  health.heading_sigma_rad = std::sqrt(covariance(kYaw, kYaw));
  health.position_spread_m = std::sqrt(covariance.topLeftCorner<2, 2>().trace());
  return health;
}

}  // namespace urban_gnss
