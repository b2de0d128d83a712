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
      statistics_(parameters) {
  initialize({});
}

void ImmEkf::initialize(const PoseEstimate& start) {
  if (!is_finite(start.pose)) throw std::invalid_argument("imm_ekf: the pose to start from is not finite");
  if (!start.covariance.allFinite()) throw std::invalid_argument("imm_ekf: the covariance to start from is not finite");
  filters_.fill(start_gaussian(start, parameters_));
  probability_ << 1.0, 0.0, 0.0;
  statistics_.reset();
}

void ImmEkf::move(const Twist2& twist, double duration_s) {
  if (!is_usable(twist, duration_s)) return;
  statistics_.move(twist, duration_s);
  const MotionStep step = make_motion_step(twist, duration_s, motion_, parameters_.odometry);
  for (Gaussian& filter : filters_) predict(filter, step, parameters_.odometry);
}

Gaussian ImmEkf::mixed_into(BiasMode to, const ModeTransition& transition, double elapsed_s) const {
  std::array<Gaussian, kLastingModes> parts = filters_;
  std::array<double, kLastingModes> weights{};
  double sum = 0.0;
  for (std::size_t i = 0; i < kLastingModes; ++i) {
    weights[i] = probability_[static_cast<int>(i)] * transition(static_cast<int>(i), static_cast<int>(index_of(to)));
    sum += weights[i];
    continue_bias(parts[i], kModes[i], to, elapsed_s, parameters_.modes);
  }
  if (!(sum > 0.0)) return parts[0];
  for (double& weight : weights) weight /= sum;
  return mixture_of(parts, weights);
}

ImmEkf::Branches ImmEkf::branch(const FixMeasurement& fix) const {
  const double elapsed_s = statistics_.elapsed_s(fix.time_s);
  const FixNoise noise = statistics_.fix_noise(fix.time_s);
  const ModeTransition transition = mode_transition(elapsed_s, parameters_.modes, statistics_.bias_odds());
  const Eigen::Vector4d prior = transition.transpose() * probability_;
  Branches branches;
  double largest = -std::numeric_limits<double>::infinity();
  bool is_finite = true;
  for (std::size_t j = 0; j < kContinuations; ++j) {
    Gaussian& filter = branches.filters[j];
    filter = mixed_into(kModes[j], transition, elapsed_s);
    branches.updates[j] = take_fix(filter, kModes[j], fix, noise, parameters_);
    is_finite = is_finite && filter.is_finite();
    branches.probability[j] = std::log(prior[static_cast<int>(j)]) + branches.updates[j].log_likelihood;
    largest = std::max(largest, branches.probability[j]);
  }
  branches.are_finite = is_finite && std::isfinite(largest);
  double sum = 0.0;
  for (double& p : branches.probability) sum += p = std::exp(p - largest);
  for (double& p : branches.probability) p /= sum;
  return branches;
}

void ImmEkf::merge(const Branches& branches) {
  constexpr std::size_t kSlow = index_of(BiasMode::kSlow);
  constexpr std::size_t kJump = index_of(BiasMode::kJump);
  const auto& p = branches.probability;
  const double slow = p[kSlow] + p[kJump];
  filters_[index_of(BiasMode::kDirect)] = branches.filters[index_of(BiasMode::kDirect)];
  filters_[index_of(BiasMode::kFast)] = branches.filters[index_of(BiasMode::kFast)];
  if (slow > 0.0) {
    filters_[kSlow] =
        mixture_of<2>({branches.filters[kSlow], branches.filters[kJump]}, {p[kSlow] / slow, p[kJump] / slow});
  }
  probability_ << p[index_of(BiasMode::kDirect)], slow, p[index_of(BiasMode::kFast)];
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
  for (std::size_t j = 0; j < kContinuations; ++j) {
    any_outlier += branches.probability[j] * branches.updates[j].outlier;
    if (branches.updates[j].white_nis > LearntScale::kMedianNis) exceeding += branches.probability[j];
  }
  statistics_.learn_fix(fix.time_s, exceeding);
  merge(branches);
  statistics_.compare_with_odometry(fix, before, mixture());

  outcome.decision = probability_[0] >= 0.5 ? FixDecision::kAccepted : FixDecision::kBiasCompensated;
  if (any_outlier > 0.5) {
    outcome.decision = FixDecision::kInflated;
    outcome.reason = "outlier, probability " + std::to_string(any_outlier);
  }
  return outcome;
}

void ImmEkf::correct_velocity(const VelocityMeasurement& measured) {
  if (!is_usable(measured)) return;
  const Eigen::Matrix2d noise = statistics_.velocity_scale() * measured.covariance;
  std::array<Gaussian, kLastingModes> next = filters_;
  ModeProbabilities log_weight;
  double exceeding = 0.0;
  for (std::size_t i = 0; i < kLastingModes; ++i) {
    const BiasEkfUpdate update = take_velocity(next[i], measured, noise, parameters_.velocity.velocity_dof);
    log_weight[static_cast<int>(i)] = update.log_likelihood;
    if (update.nis > LearntScale::kMedianNis) exceeding += probability_[static_cast<int>(i)];
    if (!next[i].is_finite()) return;
  }
  const Gaussian before = mixture();
  filters_ = next;
  probability_ = probability_.cwiseProduct((log_weight.array() - log_weight.maxCoeff()).exp().matrix());
  probability_ /= probability_.sum();
  statistics_.learn_velocity(exceeding, before, mixture());
}

Gaussian ImmEkf::mixture() const {
  return mixture_of<kLastingModes>(filters_, {probability_[0], probability_[1], probability_[2]});
}

Pose2 ImmEkf::pose() const { return mixture().pose(); }

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
