#include "urban_gnss_localization/localizers/nishida/bias_kalman_filter.hpp"

#include <Eigen/Dense>
#include <limits>

#include "urban_gnss_localization/gnss/chi_squared.hpp"

namespace urban_gnss {
namespace {

Eigen::Matrix<double, 2, 4> observation() {
  Eigen::Matrix<double, 2, 4> c = Eigen::Matrix<double, 2, 4>::Zero();
  c(0, 0) = 1.0;
  c(1, 2) = 1.0;
  return c;
}

/// What mode `literal` stands for.
GpsBiasParameters resolved(GpsBiasParameters parameters) {
  if (parameters.mode == ParticleFilterMode::kLiteral) {
    parameters.bias_input = BiasInput::kPosition;
    parameters.bias_acceleration_density = 0.0;
    parameters.gate_probability = 1.0;
  }
  return parameters;
}

}  // namespace

EnumNames<BiasInput> enum_names(BiasInput) {
  return {{"residual", BiasInput::kResidual}, {"position", BiasInput::kPosition}};
}

void BiasKalmanFilter::predict(double duration_s, double acceleration_density) {
  const double dt = duration_s;
  Eigen::Matrix4d a = Eigen::Matrix4d::Identity();
  a(0, 1) = dt;
  a(2, 3) = dt;
  Eigen::Matrix2d per_axis;
  per_axis << dt * dt * dt / 3.0, dt * dt / 2.0, dt * dt / 2.0, dt;
  per_axis *= acceleration_density * acceleration_density;
  state = a * state;
  covariance = a * covariance * a.transpose();
  covariance.topLeftCorner<2, 2>() += per_axis;
  covariance.bottomRightCorner<2, 2>() += per_axis;
}

double BiasKalmanFilter::Innovation::nis() const { return value.dot(covariance.ldlt().solve(value)); }

BiasKalmanFilter::Innovation BiasKalmanFilter::innovation(const Eigen::Vector2d& measurement,
                                                          const Eigen::Matrix2d& noise) const {
  return {measurement - position(), position_covariance() + noise};
}

void BiasKalmanFilter::correct(const Innovation& innovation, const Eigen::Matrix2d& noise) {
  const Eigen::Matrix<double, 2, 4> c = observation();
  const Eigen::Matrix<double, 4, 2> gain =
      innovation.covariance.ldlt().solve(c * covariance).transpose();  // both covariances are symmetric
  state += gain * innovation.value;
  const Eigen::Matrix4d remaining = Eigen::Matrix4d::Identity() - gain * c;
  covariance = remaining * covariance * remaining.transpose() + gain * noise * gain.transpose();
  covariance = 0.5 * (covariance + covariance.transpose()).eval();
}

Eigen::Matrix2d BiasKalmanFilter::position_covariance() const {
  Eigen::Matrix2d p;
  p << covariance(0, 0), covariance(0, 2), covariance(2, 0), covariance(2, 2);
  return p;
}

BiasTracker::BiasTracker(const GpsBiasParameters& parameters)
    : parameters_(resolved(parameters)),
      gate_threshold_(parameters_.gate_probability < 1.0 ? chi_squared_quantile(parameters_.gate_probability, kFixDof)
                                                         : std::numeric_limits<double>::infinity()) {
  reset();
}

void BiasTracker::reset() {
  filter_ = {};
  estimate_ = {};
  estimate_.shadow_threshold = chi_squared_quantile(parameters_.shadow_probability, kFixDof);
  started_ = false;
}

void BiasTracker::start(const Eigen::Vector2d& measurement) {
  // The printed filter starts on the fix; a residual starts from "no bias", which its first innovation then corrects.
  const Eigen::Vector2d position =
      parameters_.bias_input == BiasInput::kPosition ? measurement : Eigen::Vector2d(0.0, 0.0);
  const double s2 = parameters_.shadow_sigma * parameters_.shadow_sigma;
  const double v2 = parameters_.bias_rate_sigma * parameters_.bias_rate_sigma;
  filter_.state << position.x(), 0.0, position.y(), 0.0;
  filter_.covariance = Eigen::Vector4d(s2, v2, s2, v2).asDiagonal();
  started_ = true;
}

const BiasEstimate& BiasTracker::process(const LocalFix& fix, const Eigen::Vector2d& predicted_antenna_position,
                                         const FixOutcome& validation) {
  const bool on_position = parameters_.bias_input == BiasInput::kPosition;
  const Eigen::Vector2d measurement =
      on_position ? fix.position : Eigen::Vector2d(fix.position - predicted_antenna_position);
  const Eigen::Matrix2d noise = parameters_.shadow_sigma * parameters_.shadow_sigma * Eigen::Matrix2d::Identity();
  if (!started_) {
    start(measurement);
    last_accepted_ = fix.stamp;
  } else {
    filter_.predict(to_seconds(fix.stamp - last_predicted_), parameters_.bias_acceleration_density);
  }
  last_predicted_ = fix.stamp;
  estimate_.stamp = fix.stamp;
  estimate_.fix_position = fix.position;
  estimate_.predicted_antenna_position = predicted_antenna_position;

  FixOutcome outcome = validation;
  outcome.stamp = fix.stamp;
  BiasKalmanFilter::Innovation innovation = filter_.innovation(measurement, noise);
  outcome.nis = innovation.nis();
  outcome.nis_dof = kFixDof;
  outcome.nis_threshold = gate_threshold_;
  if (outcome.nis > gate_threshold_) {
    if (to_seconds(fix.stamp - last_accepted_) < parameters_.gate_timeout) {
      outcome.decision = FixDecision::kRejectedGate;
      outcome.reason = "bias innovation above its gate";
      estimate_.outcome = outcome;
      return estimate_;
    }
    // Locked out: every fix has contradicted the tracked bias for so long that the bias is what is wrong.
    start(measurement);
    filter_.state(0) = measurement.x();
    filter_.state(2) = measurement.y();
    innovation = filter_.innovation(measurement, noise);
    outcome.nis = innovation.nis();
    outcome.reason = "bias filter started anew after " + std::to_string(parameters_.gate_timeout) + " s of rejections";
  }
  filter_.correct(innovation, noise);
  last_accepted_ = fix.stamp;

  estimate_.bias = filter_.position();
  estimate_.rate = filter_.velocity();
  estimate_.covariance = filter_.position_covariance();
  estimate_.radius_m = estimate_.bias.norm();
  estimate_.shadow_statistic = estimate_.bias.dot(estimate_.covariance.ldlt().solve(estimate_.bias));
  estimate_.in_shadow = estimate_.shadow_statistic > estimate_.shadow_threshold;
  outcome.decision = estimate_.in_shadow ? FixDecision::kBiasCompensated
                     : is_rejected(validation.decision) || validation.decision == FixDecision::kNotExamined
                         ? FixDecision::kAccepted
                         : validation.decision;
  estimate_.outcome = outcome;
  return estimate_;
}

}  // namespace urban_gnss
