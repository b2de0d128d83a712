#include "urban_gnss_localization/filters/imm_ekf.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "urban_gnss_localization/gnss/chi_squared.hpp"

namespace urban_gnss {
namespace {

constexpr int kFixDof = 2;
constexpr int kVelocityDof = 2;
constexpr int kYaw = 2;
constexpr int kSpeedScale = 3;
constexpr int kYawRateScale = kErrorStates;
/// Of direct reception's normalised innovation, for the verdict alone.
constexpr double kReportedQuantile = 0.99;
constexpr BiasMode kModes[kContinuations] = {BiasMode::kDirect, BiasMode::kSlow, BiasMode::kFast, BiasMode::kJump};

using Gaussian = ImmEkf::Gaussian;
using State = ImmEkf::State;

/// Mean and covariance of a mixture whose weights sum to 1. Yaws are averaged as differences from the heaviest.
template <std::size_t N>
Gaussian match_moments(const std::array<Gaussian, N>& parts, const std::array<double, N>& weights) {
  const auto heaviest = std::max_element(weights.begin(), weights.end()) - weights.begin();
  const State& centre = parts[static_cast<std::size_t>(heaviest)].mean;
  std::array<State, N> offsets;
  State mean = State::Zero();
  for (std::size_t i = 0; i < N; ++i) {
    offsets[i] = parts[i].mean - centre;
    offsets[i][kYaw] = wrap_angle(offsets[i][kYaw]);
    mean += weights[i] * offsets[i];
  }
  Gaussian whole;
  for (std::size_t i = 0; i < N; ++i) {
    if (weights[i] <= 0.0) continue;
    const State spread = offsets[i] - mean;
    whole.covariance += weights[i] * (parts[i].covariance + spread * spread.transpose());
  }
  whole.mean = centre + mean;
  whole.mean[kYaw] = wrap_angle(whole.mean[kYaw]);
  return whole;
}

Pose2 pose_of(const State& state) { return {state[0], state[1], state[kYaw]}; }

}  // namespace

ImmEkf::ImmEkf(const ImmEkfParameters& parameters, const MotionParameters& motion)
    : parameters_(parameters),
      motion_(motion),
      nis_threshold_(chi_squared_quantile(kReportedQuantile, kFixDof)),
      noise_(parameters.noise, parameters.fix_scale_lag),
      velocity_scale_(parameters.velocity.fresh_scale()) {
  initialize({});
}

void ImmEkf::initialize(const PoseEstimate& start) {
  if (!is_finite(start.pose)) throw std::invalid_argument("imm_ekf: the pose to start from is not finite");
  if (!start.covariance.allFinite()) throw std::invalid_argument("imm_ekf: the covariance to start from is not finite");
  Gaussian first;
  first.mean.head<3>() << start.pose.x, start.pose.y, wrap_angle(start.pose.yaw);
  first.covariance.topLeftCorner<kErrorStates, kErrorStates>() =
      initial_error_covariance(start.covariance, parameters_.odometry);
  first.covariance(kYawRateScale, kYawRateScale) = parameters_.yaw_rate_scale_sigma * parameters_.yaw_rate_scale_sigma;
  filters_.fill(first);
  probability_ << 1.0, 0.0, 0.0;
  bias_odds_ = 1.0;
  noise_.reset();
  velocity_scale_ = parameters_.velocity.fresh_scale();
  last_fix_s_.reset();
  moved_s_ = 0.0;
  corrections_.setZero();
  common_variance_m2_ = 0.0;
}

void ImmEkf::move(const Twist2& twist, double duration_s) {
  if (!is_usable(twist, duration_s)) return;
  moved_s_ += duration_s;
  noise_.move(twist, duration_s);
  const MotionStep motion = make_motion_step(twist, duration_s, motion_, parameters_.odometry);
  Eigen::Matrix<double, kMotionStates, kMotionStates> transition;
  transition.setIdentity();
  for (Gaussian& filter : filters_) {
    const DeadReckoningStep step =
        dead_reckon(pose_of(filter.mean), {filter.mean[3], filter.mean[4], filter.mean[kYawRateScale]}, motion,
                    parameters_.odometry);
    filter.mean.head<3>() << step.pose.x, step.pose.y, step.pose.yaw;
    transition.topLeftCorner<kErrorStates, kErrorStates>() = step.transition;
    transition.block<3, 1>(0, kYawRateScale) = step.yaw_rate_scale;
    auto odometry = filter.covariance.topLeftCorner<kMotionStates, kMotionStates>();
    odometry = (transition * odometry * transition.transpose()).eval();
    odometry.topLeftCorner<kErrorStates, kErrorStates>() += step.noise;
    auto with_bias = filter.covariance.topRightCorner<kMotionStates, 2>();
    with_bias = (transition * with_bias).eval();
    filter.covariance.bottomLeftCorner<2, kMotionStates>() = with_bias.transpose();
  }
}

Gaussian ImmEkf::mixed_into(BiasMode to, const ModeTransition& transition, double elapsed_s) const {
  std::array<Gaussian, kLastingModes> parts = filters_;
  std::array<double, kLastingModes> weights{};
  double sum = 0.0;
  for (std::size_t i = 0; i < kLastingModes; ++i) {
    weights[i] = probability_[static_cast<int>(i)] * transition(static_cast<int>(i), static_cast<int>(index_of(to)));
    sum += weights[i];
    const BiasMode from = kModes[i];
    const bool goes_on = from != BiasMode::kDirect && (to == BiasMode::kSlow || to == BiasMode::kFast);
    Gaussian& part = parts[i];
    if (goes_on) {
      const double fade = bias_fade(elapsed_s, parameters_.modes);
      part.mean.tail<2>() *= fade;
      part.covariance.rightCols<2>() *= fade;
      part.covariance.bottomRows<2>() *= fade;
      part.covariance.diagonal().tail<2>().array() += bias_growth(to, elapsed_s, parameters_.modes);
    } else {
      const BiasState begun = predict_bias({}, from, to, elapsed_s, parameters_.modes);
      part.mean.tail<2>() = begun.mean;
      part.covariance.rightCols<2>().setZero();
      part.covariance.bottomRows<2>().setZero();
      part.covariance.diagonal().tail<2>().setConstant(begun.variance);
    }
  }
  if (!(sum > 0.0)) return parts[0];
  for (double& weight : weights) weight /= sum;
  return match_moments(parts, weights);
}

double ImmEkf::update(BiasMode mode, const FixMeasurement& fix, Continuation& continuation, double& outlier,
                      double& white_nis) const {
  Gaussian& state = continuation.state;
  const Eigen::Vector2d predicted = transform_point(pose_of(state.mean), fix.antenna_in_body);
  const Eigen::Vector2d lever = predicted - state.mean.head<2>();
  Eigen::Matrix<double, 2, kDimension> h = Eigen::Matrix<double, 2, kDimension>::Zero();
  h.leftCols<2>().setIdentity();
  h.col(kYaw) << -lever.y(), lever.x();
  const bool is_direct = mode == BiasMode::kDirect;
  if (!is_direct) h.rightCols<2>().setIdentity();

  const Eigen::Vector2d innovation =
      fix.position - predicted - (is_direct ? Eigen::Vector2d::Zero().eval() : Eigen::Vector2d(state.mean.tail<2>()));
  const Eigen::Matrix<double, kDimension, 2> with_fix = state.covariance * h.transpose();
  const Eigen::Matrix2d white = noise_.scale() * (is_direct ? parameters_.fix.direct_covariance(fix.covariance)
                                                            : parameters_.fix.shadow_covariance(fix.covariance));
  const Eigen::Matrix2d hph = h * with_fix;
  white_nis = innovation.dot((hph + white).inverse() * innovation);
  // Direct reception has the heavy tails of Student's t: a fix that is far off is one of larger noise.
  const double dof = parameters_.modes.student_dof;
  const double tail_dof = is_direct ? dof : 1e6;
  const double inflation = noise_.correlation_inflation(fix.time_s);
  const double weight = std::min(1.0, (tail_dof + kFixDof) / (tail_dof + white_nis));
  const Eigen::Matrix2d plain = hph + inflation * white;
  const double nis = innovation.dot(plain.inverse() * innovation);
  const Eigen::Matrix2d s = hph + inflation / weight * white;
  const Eigen::Matrix2d s_inverse = s.inverse();
  const double log_used = std::log1p(-parameters_.modes.outlier_share) -
                          0.5 * (tail_dof + kFixDof) * std::log1p(nis / tail_dof) - std::log(2.0 * kPi) -
                          0.5 * std::log(plain.determinant());
  const double log_outlier = std::log(parameters_.modes.outlier_density());  // -infinity where there are none
  continuation.log_weight = std::max(log_used, log_outlier) + std::log1p(std::exp(-std::abs(log_used - log_outlier)));

  // Used, or not used: matched again.
  outlier = std::exp(log_outlier - continuation.log_weight);
  const double used = 1.0 - outlier;
  const Eigen::Matrix<double, kDimension, 2> gain = with_fix * s_inverse;
  const State correction = gain * innovation;
  state.mean += used * correction;
  state.mean[kYaw] = wrap_angle(state.mean[kYaw]);
  state.covariance -= used * (gain * with_fix.transpose());
  if (outlier > 0.0) state.covariance += used * outlier * correction * correction.transpose();
  state.covariance = 0.5 * (state.covariance + state.covariance.transpose().eval());
  return nis;
}

FixVerdict ImmEkf::correct(const FixMeasurement& fix) {
  FixVerdict verdict;
  if (!is_usable(fix)) {
    verdict.decision = FixDecision::kRejectedNonFinite;
    verdict.reason = "position, time or covariance cannot be used";
    return verdict;
  }
  const Gaussian before = mixture();
  const double elapsed_s = last_fix_s_ ? std::max(fix.time_s - *last_fix_s_, 0.0) : moved_s_;
  const ModeTransition transition = mode_transition(elapsed_s, parameters_.modes, bias_odds_);
  const Eigen::Vector4d prior = transition.transpose() * probability_;
  std::array<Continuation, kContinuations> next;
  std::array<double, kContinuations> outlier{};
  std::array<double, kContinuations> white_nis{};
  std::array<double, kContinuations> posterior{};
  double largest = -std::numeric_limits<double>::infinity();
  bool is_finite = true;
  for (std::size_t j = 0; j < kContinuations; ++j) {
    next[j].prior = prior[static_cast<int>(j)];
    next[j].state = mixed_into(kModes[j], transition, elapsed_s);
    const double nis = update(kModes[j], fix, next[j], outlier[j], white_nis[j]);
    if (kModes[j] == BiasMode::kDirect) verdict.nis = nis;
    is_finite = is_finite && next[j].state.mean.allFinite() && next[j].state.covariance.allFinite();
    posterior[j] = std::log(next[j].prior) + next[j].log_weight;
    largest = std::max(largest, posterior[j]);
  }
  verdict.nis_dof = kFixDof;
  verdict.nis_threshold = nis_threshold_;
  if (!is_finite || !std::isfinite(largest)) {
    verdict.decision = FixDecision::kRejectedDegenerate;
    verdict.reason = "the update is not finite";
    return verdict;
  }
  double sum = 0.0;
  for (double& p : posterior) sum += p = std::exp(p - largest);
  double any_outlier = 0.0;
  double exceeding = 0.0;
  for (std::size_t j = 0; j < kContinuations; ++j) {
    any_outlier += (posterior[j] /= sum) * outlier[j];
    if (white_nis[j] > LearntScale::kMedianNis) exceeding += posterior[j];
  }
  noise_.learn(fix.time_s, exceeding);

  constexpr std::size_t kSlow = index_of(BiasMode::kSlow);
  constexpr std::size_t kJump = index_of(BiasMode::kJump);
  const double slow = posterior[kSlow] + posterior[kJump];
  filters_[index_of(BiasMode::kDirect)] = next[index_of(BiasMode::kDirect)].state;
  filters_[index_of(BiasMode::kFast)] = next[index_of(BiasMode::kFast)].state;
  if (slow > 0.0) {
    filters_[kSlow] =
        match_moments<2>({next[kSlow].state, next[kJump].state}, {posterior[kSlow] / slow, posterior[kJump] / slow});
  }
  probability_ << posterior[index_of(BiasMode::kDirect)], slow, posterior[index_of(BiasMode::kFast)];
  last_fix_s_ = fix.time_s;
  compare_with_odometry(fix, before);

  verdict.decision = probability_[0] >= 0.5 ? FixDecision::kAccepted : FixDecision::kBiasCompensated;
  if (any_outlier > 0.5) {
    verdict.decision = FixDecision::kInflated;
    verdict.reason = "outlier, probability " + std::to_string(any_outlier);
  }
  return verdict;
}

void ImmEkf::correct_velocity(const VelocityMeasurement& measured) {
  if (!is_usable(measured)) return;
  const double dof = parameters_.velocity.velocity_dof;
  const Eigen::Matrix2d noise = velocity_scale_.value() * measured.covariance;
  std::array<Gaussian, kLastingModes> next = filters_;
  ModeProbabilities log_weight;
  double exceeding = 0.0;
  for (std::size_t i = 0; i < kLastingModes; ++i) {
    Gaussian& state = next[i];
    const Eigen::Vector2d along = transform_point({0.0, 0.0, state.mean[kYaw]}, measured.antenna_velocity_in_body);
    const Eigen::Vector2d predicted = (1.0 + state.mean[kSpeedScale]) * along;
    Eigen::Matrix<double, 2, kDimension> h = Eigen::Matrix<double, 2, kDimension>::Zero();
    h.col(kYaw) << -predicted.y(), predicted.x();
    h.col(kSpeedScale) = along;
    const Eigen::Vector2d innovation = measured.velocity - predicted;
    const Eigen::Matrix<double, kDimension, 2> with_velocity = state.covariance * h.transpose();
    const Eigen::Matrix2d hph = h * with_velocity;
    const Eigen::Matrix2d plain = hph + noise;
    const double nis = innovation.dot(plain.inverse() * innovation);
    const double weight = std::min(1.0, (dof + kVelocityDof) / (dof + nis));
    const Eigen::Matrix2d s = hph + noise / weight;
    const Eigen::Matrix<double, kDimension, 2> gain = with_velocity * s.inverse();
    state.mean += gain * innovation;
    state.mean[kYaw] = wrap_angle(state.mean[kYaw]);
    state.covariance -= gain * with_velocity.transpose();
    state.covariance = 0.5 * (state.covariance + state.covariance.transpose().eval());
    log_weight[static_cast<int>(i)] =
        -0.5 * (dof + kVelocityDof) * std::log1p(nis / dof) - 0.5 * std::log(plain.determinant());
    if (nis > LearntScale::kMedianNis) exceeding += probability_[static_cast<int>(i)];
    if (!state.mean.allFinite() || !state.covariance.allFinite()) return;
  }
  filters_ = next;
  probability_ = probability_.cwiseProduct((log_weight.array() - log_weight.maxCoeff()).exp().matrix());
  probability_ /= probability_.sum();
  velocity_scale_.learn(exceeding);
}

void ImmEkf::compare_with_odometry(const FixMeasurement& fix, const Gaussian& before) {
  const double walk = parameters_.odometry.position_walk;
  DeadReckonedFix beside;
  beside.place = transform_point(pose_of(before.mean), fix.antenna_in_body) - corrections_;
  beside.misfit = fix.position - beside.place;
  beside.covariance = parameters_.fix.direct_covariance(fix.covariance);
  beside.walk_m2 = walk * walk * moved_s_;
  beside.heading_sigma_rad = std::sqrt(before.covariance(kYaw, kYaw));
  beside.time_s = fix.time_s;
  noise_.compare(beside);
  corrections_ += mixture().mean.head<2>() - before.mean.head<2>();
  const double common = parameters_.common_error_sigma;
  common_variance_m2_ = std::min(common * common, 0.5 * beside.covariance.trace());
}

Gaussian ImmEkf::mixture() const {
  return match_moments<kLastingModes>(filters_, {probability_[0], probability_[1], probability_[2]});
}

Pose2 ImmEkf::pose() const { return pose_of(mixture().mean); }

PoseEstimate ImmEkf::estimate() const {
  const Gaussian all = mixture();
  PoseEstimate estimate{pose_of(all.mean), all.covariance.topLeftCorner<3, 3>()};
  estimate.covariance.diagonal().head<2>().array() += common_variance_m2_;
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
