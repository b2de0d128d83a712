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
constexpr BiasMode kModes[kContinuations] = {BiasMode::kDirect, BiasMode::kSlow, BiasMode::kFast, BiasMode::kJump};

using Gaussian = ImmEkf::Gaussian;

template <std::size_t N>
Gaussian mixture_of(const std::array<Gaussian, N>& parts, const std::array<double, N>& weights) {
  return match_moments(
      N, [&](std::size_t i) -> const Gaussian& { return parts[i]; }, [&](std::size_t i) { return weights[i]; });
}

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
  filters_.fill(start_gaussian(start, parameters_));
  probability_.fill(0.0);
  for (std::size_t level = 0; level < kQualityLevels; ++level) probability_[level * kLastingModes] = 1.0;
  set_quality(prior_quality(parameters_.quality));
  statistics_.reset();
}

void ImmEkf::move(const Twist2& twist, double duration_s) {
  if (!is_usable(twist, duration_s)) return;
  statistics_.move(twist, duration_s);
  const std::array<MotionStep, kQualityLevels> steps = make_motion_steps(twist, duration_s, motion_, levels_);
  for (std::size_t i = 0; i < kFilters; ++i) {
    predict(filters_[i], steps[i / kLastingModes], levels_[i / kLastingModes]);
  }
}

void ImmEkf::doubt(const MotionDoubt& doubt) {
  for (Gaussian& filter : filters_) urban_gnss::doubt(filter, doubt);
}

ImmEkf::Branches ImmEkf::branch(const FixMeasurement& fix) const {
  const double elapsed_s = statistics_.elapsed_s(fix.time_s);
  const FixNoise noise = statistics_.fix_noise(fix.time_s);
  const ModeTransition transition = mode_transition(elapsed_s, parameters_.modes, statistics_.bias_odds());
  const QualityTransition quality = quality_transition(elapsed_s, parameters_.quality);
  Branches branches;
  branches.expected_quality = quality.transpose() * quality_probabilities();
  double largest = -std::numeric_limits<double>::infinity();
  bool is_finite = true;
  for (std::size_t level = 0; level < kQualityLevels; ++level) {
    // First the qualities, of each mode for itself: how a bias goes on from there does not depend on them.
    std::array<Gaussian, kLastingModes> modes;
    std::array<double, kLastingModes> before{};
    for (std::size_t m = 0; m < kLastingModes; ++m) {
      std::array<double, kQualityLevels> weights{};
      for (std::size_t from = 0; from < kQualityLevels; ++from) {
        before[m] += weights[from] =
            probability_[from * kLastingModes + m] * quality(static_cast<int>(from), static_cast<int>(level));
      }
      modes[m] = filters_[level * kLastingModes + m];
      if (before[m] > 0.0) {
        modes[m] = match_moments(
            kQualityLevels, [&](std::size_t from) -> const Gaussian& { return filters_[from * kLastingModes + m]; },
            [&](std::size_t from) { return weights[from] / before[m]; });
      }
    }
    for (std::size_t j = 0; j < kContinuations; ++j) {
      std::array<Gaussian, kLastingModes> parts = modes;
      std::array<double, kLastingModes> weights{};
      double sum = 0.0;
      for (std::size_t m = 0; m < kLastingModes; ++m) {
        continue_bias(parts[m], kModes[m], kModes[j], elapsed_s, parameters_.modes);
        sum += weights[m] = before[m] * transition(static_cast<int>(m), static_cast<int>(j));
      }
      const std::size_t branch = level * kContinuations + j;
      Gaussian& filter = branches.filters[branch];
      if (sum > 0.0) {
        for (double& weight : weights) weight /= sum;
        filter = mixture_of(parts, weights);
      } else {
        filter = parts[0];
      }
      branches.updates[branch] = take_fix(filter, kModes[j], fix, noise, parameters_);
      is_finite = is_finite && filter.is_finite();
      branches.probability[branch] = std::log(sum) + branches.updates[branch].log_likelihood;
      largest = std::max(largest, branches.probability[branch]);
    }
  }
  branches.are_finite = is_finite && std::isfinite(largest);
  double sum = 0.0;
  for (double& p : branches.probability) sum += p = std::exp(p - largest);
  for (double& p : branches.probability) p /= sum;
  return branches;
}

void ImmEkf::merge(const Branches& branches) {
  constexpr std::size_t kDirect = index_of(BiasMode::kDirect);
  constexpr std::size_t kSlow = index_of(BiasMode::kSlow);
  constexpr std::size_t kFast = index_of(BiasMode::kFast);
  constexpr std::size_t kJump = index_of(BiasMode::kJump);
  for (std::size_t level = 0; level < kQualityLevels; ++level) {
    const double* p = &branches.probability[level * kContinuations];
    const Gaussian* filters = &branches.filters[level * kContinuations];
    Gaussian* merged = &filters_[level * kLastingModes];
    double* probability = &probability_[level * kLastingModes];
    const double slow = p[kSlow] + p[kJump];
    merged[kDirect] = filters[kDirect];
    merged[kFast] = filters[kFast];
    if (slow > 0.0) merged[kSlow] = mixture_of<2>({filters[kSlow], filters[kJump]}, {p[kSlow] / slow, p[kJump] / slow});
    probability[kDirect] = p[kDirect];
    probability[kSlow] = slow;
    probability[kFast] = p[kFast];
  }
}

FixOutcome ImmEkf::correct(const FixMeasurement& declared) {
  FixOutcome outcome;
  if (!is_usable(declared)) {
    outcome.decision = FixDecision::kRejectedNonFinite;
    outcome.reason = "position, time or covariance cannot be used";
    return outcome;
  }
  const Gaussian before = mixture();
  const FixMeasurement fix = statistics_.effective_fix(declared, before);
  const Branches branches = branch(fix);
  outcome.of_ranges = statistics_.of_ranges();
  outcome.nis = branches.updates[index_of(BiasMode::kDirect)].nis;
  outcome.nis_dof = kFixDof;
  outcome.nis_threshold = nis_threshold_;
  if (!branches.are_finite) {
    outcome.decision = FixDecision::kRejectedDegenerate;
    outcome.reason = "the update is not finite";
    return outcome;
  }
  double any_outlier = 0.0;
  double exceeding = 0.0;
  for (std::size_t j = 0; j < kBranches; ++j) {
    any_outlier += branches.probability[j] * branches.updates[j].outlier;
    if (branches.updates[j].white_nis > LearntScale::kMedianNis) exceeding += branches.probability[j];
  }
  statistics_.learn_fix(fix.time_s, exceeding);
  merge(branches);
  set_quality(bounded_quality(branches.expected_quality, quality_probabilities(), parameters_.quality));
  statistics_.compare_with_odometry(fix, before, mixture());

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
  std::array<Gaussian, kFilters> next = filters_;
  std::array<double, kFilters> weight{};
  double exceeding = 0.0;
  double largest = -std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < kFilters; ++i) {
    const BiasEkfUpdate update = take_velocity(next[i], measured, noise, inflation, parameters_.velocity.velocity_dof);
    if (update.white_nis > LearntScale::kMedianNis) exceeding += probability_[i];
    if (!next[i].is_finite()) return;
    weight[i] = std::log(probability_[i]) + update.log_likelihood;
    largest = std::max(largest, weight[i]);
  }
  if (!std::isfinite(largest)) return;
  const Gaussian before = mixture();
  const QualityProbabilities quality = quality_probabilities();
  filters_ = next;
  for (std::size_t i = 0; i < kFilters; ++i) probability_[i] = std::exp(weight[i] - largest);
  set_quality(quality);  // errors of velocities last, and look like a heading that wanders
  statistics_.learn_velocity(measured.time_s, exceeding, before, mixture());
}

Gaussian ImmEkf::mixture() const { return mixture_of(filters_, probability_); }

Gaussian ImmEkf::given(BiasMode mode) const {
  std::array<double, kFilters> weights{};
  double sum = 0.0;
  for (std::size_t i = 0; i < kFilters; ++i) {
    if (i % kLastingModes == index_of(lasting(mode))) sum += weights[i] = probability_[i];
  }
  if (!(sum > 0.0)) return filters_[index_of(lasting(mode))];
  for (double& weight : weights) weight /= sum;
  return mixture_of(filters_, weights);
}

ModeProbabilities ImmEkf::mode_probabilities() const {
  ModeProbabilities sums = ModeProbabilities::Zero();
  for (std::size_t i = 0; i < kFilters; ++i) sums[static_cast<int>(i % kLastingModes)] += probability_[i];
  return sums;
}

void ImmEkf::set_quality(const QualityProbabilities& target) {
  const QualityProbabilities factors = rescaling(quality_probabilities(), target);
  for (std::size_t i = 0; i < kFilters; ++i) probability_[i] *= factors[static_cast<int>(i / kLastingModes)];
}

QualityProbabilities ImmEkf::quality_probabilities() const {
  QualityProbabilities sums = QualityProbabilities::Zero();
  for (std::size_t i = 0; i < kFilters; ++i) sums[static_cast<int>(i / kLastingModes)] += probability_[i];
  return sums;
}

Pose2 ImmEkf::pose() const {
  const BiasEkfState mean = match_means(
      kFilters, [&](std::size_t i) -> const Gaussian& { return filters_[i]; },
      [&](std::size_t i) { return probability_[i]; });
  return {mean[0], mean[1], mean[kYaw]};
}

PoseEstimate ImmEkf::estimate() const {
  const Gaussian all = mixture();
  PoseEstimate estimate{all.pose(), all.covariance.topLeftCorner<3, 3>()};
  estimate.covariance.diagonal().head<2>().array() += statistics_.common_variance_m2();
  return estimate;
}

LocalizerHealth ImmEkf::health() const {
  const Gaussian all = mixture();
  LocalizerHealth health;
  health.heading_sigma_rad = std::sqrt(all.covariance(kYaw, kYaw));
  health.position_spread_m = std::sqrt(all.covariance.topLeftCorner<2, 2>().trace());
  return health;
}

}  // namespace urban_gnss
