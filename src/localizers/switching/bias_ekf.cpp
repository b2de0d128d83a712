#include "urban_gnss_localization/localizers/switching/bias_ekf.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace urban_gnss {
namespace {

constexpr int kFixDof = 2;
constexpr int kVelocityDof = 2;
constexpr int kYaw = 2;
constexpr int kSpeedScale = 3;
constexpr int kYawRateScale = kErrorStates;

using Sensitivity = Eigen::Matrix<double, 2, kBiasStates>;
using Gain = Eigen::Matrix<double, kBiasStates, 2>;

/// A fix of ranges tells its own covariance; what is learnt is how good ranges in line of sight are: the factor on the
/// square of middle_range_sigma_m().
FixNoiseModelParameters range_noise(const SwitchingModelParameters& p) {
  FixNoiseModelParameters noise = p.noise;
  noise.fix_correlation_time = p.ranges.range_correlation_time;
  const double middle_m = p.ranges.middle_range_sigma_m();
  noise.fix_scale_limit = p.ranges.range_sigma_max / middle_m;
  noise.first_fix_scale = std::pow(p.ranges.range_sigma / middle_m, 2);
  return noise;
}

void make_symmetric(BiasEkfCovariance& covariance) { covariance = 0.5 * (covariance + covariance.transpose().eval()); }

}  // namespace

BiasGaussian start_gaussian(const PoseEstimate& start, const SwitchingModelParameters& p) {
  BiasGaussian first;
  first.mean.head<3>() << start.pose.x, start.pose.y, wrap_angle(start.pose.yaw);
  first.covariance.topLeftCorner<kErrorStates, kErrorStates>() = initial_error_covariance(start.covariance, p.odometry);
  first.covariance(kYawRateScale, kYawRateScale) = p.yaw_rate_scale_sigma * p.yaw_rate_scale_sigma;
  return first;
}

BiasEkfState difference(const BiasEkfState& a, const BiasEkfState& b) {
  BiasEkfState apart = a - b;
  apart[kYaw] = wrap_angle(apart[kYaw]);
  return apart;
}

void predict(BiasGaussian& state, const MotionStep& motion, const OdometryErrorParameters& p) {
  const DeadReckoningStep step =
      dead_reckon(state.pose(), {state.mean[kSpeedScale], state.mean[4], state.mean[kYawRateScale]}, motion, p);
  state.mean.head<3>() << step.pose.x, step.pose.y, step.pose.yaw;
  Eigen::Matrix<double, kMotionStates, kMotionStates> transition;
  transition.setIdentity();
  transition.topLeftCorner<kErrorStates, kErrorStates>() = step.transition;
  transition.block<3, 1>(0, kYawRateScale) = step.yaw_rate_scale;
  auto odometry = state.covariance.topLeftCorner<kMotionStates, kMotionStates>();
  odometry = (transition * odometry * transition.transpose()).eval();
  odometry.topLeftCorner<kErrorStates, kErrorStates>() += step.noise;
  auto with_bias = state.covariance.topRightCorner<kMotionStates, 2>();
  with_bias = (transition * with_bias).eval();
  state.covariance.bottomLeftCorner<2, kMotionStates>() = with_bias.transpose();
}

void continue_bias(BiasGaussian& state, BiasMode from, BiasMode to, double elapsed_s, const BiasModeParameters& p) {
  const bool goes_on = from != BiasMode::kDirect && (to == BiasMode::kSlow || to == BiasMode::kFast);
  if (goes_on) {
    const double fade = bias_fade(elapsed_s, p);
    state.mean.tail<2>() *= fade;
    state.covariance.rightCols<2>() *= fade;
    state.covariance.bottomRows<2>() *= fade;
    state.covariance.diagonal().tail<2>().array() += bias_growth(to, elapsed_s, p);
  } else {
    const BiasState begun = predict_bias({}, from, to, elapsed_s, p);
    state.mean.tail<2>() = begun.mean;
    state.covariance.rightCols<2>().setZero();
    state.covariance.bottomRows<2>().setZero();
    state.covariance.diagonal().tail<2>().setConstant(begun.variance);
  }
}

BiasEkfUpdate take_fix(BiasGaussian& state, BiasMode mode, const FixMeasurement& fix, const FixNoise& noise,
                       const SwitchingModelParameters& p) {
  const Eigen::Vector2d predicted = transform_point(state.pose(), fix.antenna_in_body);
  const Eigen::Vector2d lever = predicted - state.mean.head<2>();
  Sensitivity h = Sensitivity::Zero();
  h.leftCols<2>().setIdentity();
  h.col(kYaw) << -lever.y(), lever.x();
  const bool is_direct = mode == BiasMode::kDirect;
  if (!is_direct) h.rightCols<2>().setIdentity();

  const Eigen::Vector2d innovation =
      fix.position - predicted - (is_direct ? Eigen::Vector2d::Zero().eval() : Eigen::Vector2d(state.mean.tail<2>()));
  const Gain with_fix = state.covariance * h.transpose();
  Eigen::Matrix2d white = fix.covariance;
  if (!noise.of_ranges) {
    white =
        noise.scale * (is_direct ? p.fix.direct_covariance(fix.covariance) : p.fix.shadow_covariance(fix.covariance));
  }
  const Eigen::Matrix2d hph = h * with_fix;
  BiasEkfUpdate update;
  update.white_nis = innovation.dot((hph + white).inverse() * innovation);
  const double tail_dof = is_direct ? p.modes.student_dof : 1e6;
  const double weight = std::min(1.0, (tail_dof + kFixDof) / (tail_dof + update.white_nis));
  const Eigen::Matrix2d plain = hph + noise.inflation * white;
  update.nis = innovation.dot(plain.inverse() * innovation);
  const Eigen::Matrix2d s = hph + noise.inflation / weight * white;
  const Eigen::Matrix2d s_inverse = s.inverse();
  const double log_used = std::log1p(-p.modes.outlier_share) -
                          0.5 * (tail_dof + kFixDof) * std::log1p(update.nis / tail_dof) - std::log(2.0 * kPi) -
                          0.5 * std::log(plain.determinant());
  const double log_outlier = std::log(p.modes.outlier_density());  // -infinity where there are none
  update.log_likelihood = std::max(log_used, log_outlier) + std::log1p(std::exp(-std::abs(log_used - log_outlier)));

  update.outlier = std::exp(log_outlier - update.log_likelihood);
  const double used = 1.0 - update.outlier;
  const Gain gain = with_fix * s_inverse;
  const BiasEkfState correction = gain * innovation;
  state.mean += used * correction;
  state.mean[kYaw] = wrap_angle(state.mean[kYaw]);
  state.covariance -= used * (gain * with_fix.transpose());
  if (update.outlier > 0.0) state.covariance += used * update.outlier * correction * correction.transpose();
  make_symmetric(state.covariance);
  return update;
}

BiasEkfUpdate take_velocity(BiasGaussian& state, const VelocityMeasurement& measured, const Eigen::Matrix2d& noise,
                            double dof) {
  const Eigen::Vector2d along = transform_point({0.0, 0.0, state.mean[kYaw]}, measured.antenna_velocity_in_body);
  const Eigen::Vector2d predicted = (1.0 + state.mean[kSpeedScale]) * along;
  Sensitivity h = Sensitivity::Zero();
  h.col(kYaw) << -predicted.y(), predicted.x();
  h.col(kSpeedScale) = along;
  const Eigen::Vector2d innovation = measured.velocity - predicted;
  const Gain with_velocity = state.covariance * h.transpose();
  const Eigen::Matrix2d hph = h * with_velocity;
  const Eigen::Matrix2d plain = hph + noise;
  BiasEkfUpdate update;
  update.nis = update.white_nis = innovation.dot(plain.inverse() * innovation);
  const double weight = std::min(1.0, (dof + kVelocityDof) / (dof + update.nis));
  const Eigen::Matrix2d s = hph + noise / weight;
  const Gain gain = with_velocity * s.inverse();
  state.mean += gain * innovation;
  state.mean[kYaw] = wrap_angle(state.mean[kYaw]);
  state.covariance -= gain * with_velocity.transpose();
  make_symmetric(state.covariance);
  update.log_likelihood =
      -0.5 * (dof + kVelocityDof) * std::log1p(update.nis / dof) - 0.5 * std::log(plain.determinant());
  return update;
}

ReceiverModel::ReceiverModel(const SwitchingModelParameters& parameters)
    : parameters_(parameters),
      noise_(parameters.noise, parameters.fix_scale_lag),
      range_noise_(range_noise(parameters)),
      velocity_scale_(parameters.velocity.fresh_scale()) {}

void ReceiverModel::reset() {
  noise_.reset();
  range_noise_.reset();
  free_signals_.reset();
  of_ranges_ = false;
  velocity_scale_ = parameters_.velocity.fresh_scale();
  last_fix_s_.reset();
  moved_s_ = 0.0;
  corrections_.setZero();
  common_variance_m2_ = 0.0;
}

void ReceiverModel::move(const Twist2& twist, double duration_s) {
  moved_s_ += duration_s;
  noise_.move(twist, duration_s);
  range_noise_.move(twist, duration_s);
}

double ReceiverModel::elapsed_s(double time_s) const {
  return last_fix_s_ ? std::max(time_s - *last_fix_s_, 0.0) : moved_s_;
}

double ReceiverModel::range_sigma_m() const {
  if (parameters_.noise.fix_scale_rate == 0.0) return parameters_.ranges.range_sigma;
  return parameters_.ranges.middle_range_sigma_m() * std::sqrt(range_noise_.scale());
}

FixMeasurement ReceiverModel::believed(const FixMeasurement& fix, const BiasGaussian& before) {
  FixMeasurement weighed = fix;
  of_ranges_ = false;
  if (parameters_.ranges.use_ranges && !fix.satellites.empty()) {
    free_signals_.add(fix.satellites, parameters_.ranges);
    RelativePlace known;
    known.offset = transform_point(before.pose(), fix.antenna_in_body) - fix.position;
    known.covariance = before.covariance.topLeftCorner<2, 2>();
    const auto level = free_signals_.cn0_dbhz();
    RangeFixParameters ranges = parameters_.ranges;
    ranges.range_sigma = range_sigma_m();
    const auto place = level ? range_fix(fix.satellites, *level, known, ranges) : std::nullopt;
    if (place) {
      of_ranges_ = true;
      weighed.position += place->offset;
      weighed.covariance = place->covariance;
      return weighed;
    }
  }
  weighed.covariance = noise_.believed(fix.covariance);
  return weighed;
}

void ReceiverModel::learn_velocity(double exceeding, const BiasGaussian& before, const BiasGaussian& after) {
  velocity_scale_.learn(exceeding);
  corrections_ += after.mean.head<2>() - before.mean.head<2>();
}

void ReceiverModel::learn_fix(double time_s, double exceeding) {
  (of_ranges_ ? range_noise_ : noise_).learn(time_s, exceeding);
  last_fix_s_ = time_s;
}

void ReceiverModel::compare_with_odometry(const FixMeasurement& fix, const BiasGaussian& before,
                                          const BiasGaussian& after) {
  const double walk = parameters_.odometry.position_walk;
  DeadReckonedFix beside;
  beside.place = transform_point(before.pose(), fix.antenna_in_body) - corrections_;
  beside.misfit = fix.position - beside.place;
  beside.covariance = parameters_.fix.direct_covariance(fix.covariance);
  beside.walk_m2 = walk * walk * moved_s_;
  beside.heading_sigma_rad = std::sqrt(before.covariance(kYaw, kYaw));
  beside.time_s = fix.time_s;
  if (!of_ranges_) noise_.compare(beside);
  corrections_ += after.mean.head<2>() - before.mean.head<2>();
  const double common = parameters_.common_error_sigma;
  common_variance_m2_ = std::min(common * common, 0.5 * beside.covariance.trace());
}

}  // namespace urban_gnss
