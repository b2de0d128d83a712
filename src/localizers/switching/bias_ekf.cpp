#include "urban_gnss_localization/localizers/switching/bias_ekf.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "urban_gnss_localization/gnss/chi_squared.hpp"

namespace urban_gnss {
namespace {

constexpr int kVelocityDof = 2;
constexpr int kYaw = 2;
constexpr int kSpeedScale = 3;
constexpr int kYawRateScale = kErrorStates;

using Sensitivity = Eigen::Matrix<double, 2, kBiasStates>;
using Gain = Eigen::Matrix<double, kBiasStates, 2>;

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
  // The transition is I + A, where A is 0 but for three rows, of the pose, and for these columns: P + A P + P A' + A P
  // A'.
  constexpr int kFrom = kYaw;
  constexpr int kColumns = kMotionStates - kFrom;
  Eigen::Matrix<double, 3, kColumns> a;
  a << step.transition.topRightCorner<3, kErrorStates - kFrom>(), step.yaw_rate_scale;
  a(kYaw, kYaw - kFrom) -= 1.0;
  const Eigen::Matrix<double, 3, kBiasStates> ap = a * state.covariance.middleRows<kColumns>(kFrom);
  const Eigen::Matrix3d apa = ap.middleCols<kColumns>(kFrom) * a.transpose();
  state.covariance.topRows<3>() += ap;
  state.covariance.leftCols<3>() += ap.transpose();
  state.covariance.topLeftCorner<3, 3>() += apa;
  state.covariance.topLeftCorner<kErrorStates, kErrorStates>() += step.noise;
}

void doubt(BiasGaussian& state, const MotionDoubt& doubt) {
  state.covariance.diagonal().head<2>().array() += doubt.position_m2;
  state.covariance(kYaw, kYaw) += doubt.heading_rad2;
}

void continue_bias(BiasGaussian& state, const BiasStep& step) {
  state.mean.tail<2>() *= step.left;
  state.covariance.rightCols<2>() *= step.left;
  state.covariance.bottomRows<2>() *= step.left;
  state.covariance.diagonal().tail<2>().array() += step.growth_m2;
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
  white.diagonal().array() += noise.added_m2;
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
                            double inflation, double dof) {
  const Eigen::Vector2d along = transform_point({0.0, 0.0, state.mean[kYaw]}, measured.antenna_velocity_in_body);
  const Eigen::Vector2d predicted = (1.0 + state.mean[kSpeedScale]) * along;
  Sensitivity h = Sensitivity::Zero();
  h.col(kYaw) << -predicted.y(), predicted.x();
  h.col(kSpeedScale) = along;
  const Eigen::Vector2d innovation = measured.velocity - predicted;
  const Gain with_velocity = state.covariance * h.transpose();
  const Eigen::Matrix2d hph = h * with_velocity;
  const Eigen::Matrix2d plain = hph + inflation * noise;
  BiasEkfUpdate update;
  update.white_nis = innovation.dot((hph + noise).inverse() * innovation);
  update.nis = innovation.dot(plain.inverse() * innovation);
  const double weight = std::min(1.0, (dof + kVelocityDof) / (dof + update.white_nis));
  const Eigen::Matrix2d s = hph + inflation / weight * noise;
  const Gain gain = with_velocity * s.inverse();
  state.mean += gain * innovation;
  state.mean[kYaw] = wrap_angle(state.mean[kYaw]);
  state.covariance -= gain * with_velocity.transpose();
  make_symmetric(state.covariance);
  update.log_likelihood =
      -0.5 * (dof + kVelocityDof) * std::log1p(update.nis / dof) - 0.5 * std::log(plain.determinant());
  return update;
}

}  // namespace urban_gnss
