#include "urban_gnss_localization/localizers/maier/ukf.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "urban_gnss_localization/common/positive_definite.hpp"
#include "urban_gnss_localization/gnss/chi_squared.hpp"
#include "urban_gnss_localization/motion/dead_reckoning.hpp"
#include "urban_gnss_localization/motion/standstill.hpp"

namespace urban_gnss {
namespace {

constexpr int kNoise = 3;  ///< speed, second input, yaw rate: MotionNoise
constexpr int kYaw = 2;

/// A column for each of at most `Most` axes, in both directions.
template <int Rows, int Most>
using BothWays = Eigen::Matrix<double, Rows, Eigen::Dynamic, 0, Rows, 2 * Most>;

/// Square of the standard deviations beyond which a bearing is not believed.
constexpr double kBearingGate = 9.0;

constexpr double kUnknownYawVariance = kPi * kPi / 3.0;

/// g of eq. (1): the pose after one step of odometry, freed of the errors that the state holds.
Pose2 moved(const Ukf::State& state, const MotionStep& step, const MotionNoise& noise) {
  return move_noisily({state[0], state[1], state[kYaw]}, step, noise, {state[3], state[4]});
}

void limit_yaw_variance(Ukf::Covariance& covariance) {
  const double variance = covariance(kYaw, kYaw);
  if (variance <= kUnknownYawVariance) return;
  const double factor = std::sqrt(kUnknownYawVariance / variance);
  covariance.row(kYaw) *= factor;
  covariance.col(kYaw) *= factor;
}

template <int N>
bool make_positive_definite(Eigen::Matrix<double, N, N>& covariance) {
  if (!is_positive_definite(covariance)) covariance = nearest_positive_definite(covariance);
  return is_positive_definite(covariance);
}

/// Fixes are what they declare, with independent errors.
UkfParameters with_declared_noise(UkfParameters p) {
  p.fix_noise.fix_scale_rate = 0.0;
  p.fix_noise.fix_covariance_weight = 1.0;
  p.fix_noise.fix_scale_lag = 0.0;
  p.fix_noise.errors = {0.0, 0.0};
  p.reacquisition.reacquisition_sigma = 0.0;
  p.common_error = {0.0, 0.0, 0.0};
  return p;
}

}  // namespace

EnumNames<UkfMode> enum_names(UkfMode) {
  return {{"standard", UkfMode::kStandard}, {"as_printed", UkfMode::kAsPrinted}};
}

EnumNames<OutlierPolicy> enum_names(OutlierPolicy) {
  return {{"student_t", OutlierPolicy::kStudentT}, {"gate", OutlierPolicy::kGate}, {"none", OutlierPolicy::kNone}};
}

UkfParameters published_ukf() {
  UkfParameters p = with_declared_noise({});
  p.fix_noise.errors = {0.0, 1.0};
  p.odometry = {0.1, 0.03, 2e-4, 0.005, 3e-5, 0.0, 0.0, 0.03};
  return p;
}

UkfParameters as_printed(UkfParameters parameters) {
  parameters = with_declared_noise(parameters);
  parameters.mode = UkfMode::kAsPrinted;
  parameters.outliers = OutlierPolicy::kNone;
  parameters.odometry = {1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0};
  return parameters;
}

Ukf::Ukf(const UkfParameters& parameters, const MotionParameters& motion)
    : parameters_(parameters.mode == UkfMode::kAsPrinted ? as_printed(parameters) : parameters),
      motion_(motion),
      motion_weights_(
          UnscentedWeights::of(states() + kNoise, parameters.ukf_alpha, parameters.ukf_beta, parameters.ukf_kappa)),
      fix_weights_(UnscentedWeights::of(states(), parameters.ukf_alpha, parameters.ukf_beta, parameters.ukf_kappa)),
      nis_threshold_(parameters.gate_probability < 1.0 ? chi_squared_quantile(parameters.gate_probability, kFixDof)
                                                       : std::numeric_limits<double>::infinity()),
      noise_(parameters_.fix_noise),
      reacquisition_(parameters_.reacquisition) {
  initialize({});
}

void Ukf::initialize(const PoseEstimate& start) {
  if (!is_finite(start.pose)) throw std::invalid_argument("ukf: the pose to start from is not finite");
  if (!start.covariance.allFinite()) throw std::invalid_argument("ukf: the covariance to start from is not finite");
  covariance_ = initial_error_covariance(start.covariance, parameters_.odometry);
  state_ << start.pose.x, start.pose.y, wrap_angle(start.pose.yaw), 0.0, 0.0;
  repair(covariance_);
  limit_yaw_variance(covariance_);
  noise_.reset();
  track_ = {};
  reacquisition_.reset();
  common_variance_m2_ = 0.0;
  rejected_since_s_.reset();
}

void Ukf::move(const Twist2& twist, double duration_s) {
  if (!is_usable(twist, duration_s)) return;
  noise_.move(twist, duration_s);
  track_.move(twist, duration_s);
  if (is_standstill(twist, parameters_.odometry.standstill_radps)) {
    const double walk = parameters_.odometry.parked_walk;
    doubt({walk * walk * duration_s, 0.0});
    return;
  }
  const MotionStep step = make_motion_step(twist, duration_s, motion_, parameters_.odometry);
  const Pose2 centre = moved(state_, step, {});
  const double centre_turn = angle_difference(centre.yaw, state_[kYaw]);
  const Covariance spread = motion_weights_.spread * root();

  // Differences of the moved points from the moved centre.
  BothWays<kDimension, kDimension + kNoise> differences(kDimension, 2 * (states() + kNoise));
  for (int i = 0; i < differences.cols(); ++i) {
    const int axis = i / 2;
    const double sign = i % 2 == 0 ? 1.0 : -1.0;
    State offset = State::Zero();
    MotionNoise noise;
    if (axis < states()) {
      offset = sign * spread.col(axis);
    } else {
      const double draw = sign * motion_weights_.spread;
      (axis == states() ? noise.speed : axis == states() + 1 ? noise.input : noise.yaw_rate) = draw;
    }
    const State point = state_ + offset;
    const Pose2 pose = moved(point, step, noise);
    const double turn = angle_difference(pose.yaw, point[kYaw]);
    differences.col(i) << pose.x - centre.x, pose.y - centre.y, offset[kYaw] + angle_difference(turn, centre_turn),
        offset[3], offset[4];
  }
  const State mean = motion_weights_.other * differences.rowwise().sum();
  const auto centred = differences.colwise() - mean;
  Covariance covariance = motion_weights_.other * centred * centred.transpose() +
                          motion_weights_.centre_covariance * mean * mean.transpose();
  const double scale_walk = parameters_.odometry.speed_scale_walk;
  const double bias_walk = parameters_.odometry.yaw_rate_bias_walk;
  const double position_walk = parameters_.odometry.position_walk;
  const double heading_walk = parameters_.odometry.heading_walk;
  covariance.diagonal().head<2>().array() += position_walk * position_walk * duration_s;
  covariance(kYaw, kYaw) += heading_walk * heading_walk * duration_s;
  covariance(3, 3) += scale_walk * scale_walk * duration_s;
  covariance(4, 4) += bias_walk * bias_walk * duration_s;

  State state = state_;
  state.head<3>() << centre.x, centre.y, centre.yaw;
  accept(state + mean, covariance);
}

void Ukf::doubt(const MotionDoubt& doubt) {
  Covariance covariance = covariance_;
  covariance.diagonal().head<2>().array() += doubt.position_m2;
  covariance(kYaw, kYaw) += doubt.heading_rad2;
  accept(state_, covariance);
}

bool Ukf::accept(State state, Covariance covariance) {
  if (!state.allFinite() || !covariance.allFinite()) return false;
  state[kYaw] = wrap_angle(state[kYaw]);
  covariance = 0.5 * (covariance + covariance.transpose().eval());
  limit_yaw_variance(covariance);
  if (!repair(covariance)) return false;
  state_ = state;
  covariance_ = covariance;
  return true;
}

bool Ukf::repair(Covariance& covariance) const {
  if (states() == kDimension) return make_positive_definite(covariance);
  Eigen::Matrix3d of_pose = covariance.topLeftCorner<3, 3>();
  const bool is_usable = make_positive_definite(of_pose);
  covariance.setZero();
  covariance.topLeftCorner<3, 3>() = of_pose;
  return is_usable;
}

Ukf::Covariance Ukf::root() const {
  if (states() == kDimension) return cholesky_root(covariance_);
  Covariance root = Covariance::Zero();
  root.topLeftCorner<3, 3>() = cholesky_root<3>(covariance_.topLeftCorner<3, 3>());
  return root;
}

Ukf::Prediction Ukf::predict(const Eigen::Vector2d& antenna_in_body) const {
  const Eigen::Vector2d centre = transform_point(pose(), antenna_in_body);
  const Covariance spread = fix_weights_.spread * root();
  BothWays<2, kDimension> differences(2, 2 * states());
  BothWays<kDimension, kDimension> offsets(kDimension, 2 * states());
  for (int i = 0; i < offsets.cols(); ++i) {
    offsets.col(i) = (i % 2 == 0 ? 1.0 : -1.0) * spread.col(i / 2);
    const State point = state_ + offsets.col(i);
    differences.col(i) = transform_point({point[0], point[1], point[kYaw]}, antenna_in_body) - centre;
  }
  const Eigen::Vector2d mean = fix_weights_.other * differences.rowwise().sum();
  const auto centred = differences.colwise() - mean;
  Prediction prediction;
  prediction.position = centre + mean;
  prediction.covariance =
      fix_weights_.other * centred * centred.transpose() + fix_weights_.centre_covariance * mean * mean.transpose();
  prediction.with_state = fix_weights_.other * offsets * centred.transpose();
  return prediction;
}

FixOutcome Ukf::correct(const FixMeasurement& declared) {
  FixOutcome outcome;
  if (!is_usable(declared)) {
    outcome.decision = FixDecision::kRejectedNonFinite;
    outcome.reason = "position, time or covariance cannot be used";
    return outcome;
  }
  FixMeasurement fix = declared;
  const Eigen::Matrix2d effective = noise_.effective_covariance(declared.covariance);
  fix.covariance = noise_.scale() * effective;
  fix.covariance.diagonal().array() += reacquisition_.variance_m2(declared.time_s);
  reacquisition_.add(declared.time_s);
  const State before = state_;
  Prediction prediction = predict(fix.antenna_in_body);
  const Eigen::Vector2d innovation = fix.position - prediction.position;
  outcome.nis = innovation.dot((prediction.covariance + fix.covariance).ldlt().solve(innovation));
  outcome.nis_dof = kFixDof;
  outcome.nis_threshold = nis_threshold_;
  outcome.decision = FixDecision::kAccepted;
  if (is_settled_by_gate(fix, innovation, outcome)) return outcome;

  double weight = 1.0;
  if (parameters_.outliers == OutlierPolicy::kStudentT) {
    weight = std::min(1.0, (parameters_.student_dof + kFixDof) / (parameters_.student_dof + outcome.nis));
    if (outcome.nis > nis_threshold_) {
      outcome.decision = FixDecision::kInflated;
      outcome.reason = "outlier, weight " + std::to_string(weight);
    }
  }
  const Eigen::Matrix2d noise = noise_.correlation_inflation(fix.time_s) / weight * fix.covariance;
  const Eigen::Matrix2d innovation_covariance = prediction.covariance + noise;
  const Eigen::Matrix<double, kDimension, 2> gain =
      innovation_covariance.ldlt().solve(prediction.with_state.transpose()).transpose();
  if (!accept(state_ + gain * innovation, covariance_ - gain * innovation_covariance * gain.transpose())) {
    outcome.decision = FixDecision::kRejectedDegenerate;
    outcome.reason = "the update is not finite";
    return outcome;
  }
  fix.covariance = effective;
  learn(fix, outcome.nis, prediction.position, before);
  return outcome;
}

void Ukf::correct_heading(const HeadingMeasurement& heading) {
  if (!is_usable(heading)) return;
  const double known = covariance_(kYaw, kYaw);
  const double told = heading.sigma_rad * heading.sigma_rad;
  const double innovation = angle_difference(heading.yaw_rad, state_[kYaw]);
  if (known <= told || innovation * innovation > kBearingGate * (known + told)) return;
  // The innovation's variance that leaves the yaw with `told`: known (1 - known / innovation variance) = told.
  const double innovation_variance = known * known / (known - told);
  const State gain = covariance_.col(kYaw) / innovation_variance;
  accept(state_ + gain * innovation, covariance_ - innovation_variance * gain * gain.transpose());
}

void Ukf::learn(const FixMeasurement& declared, double nis, const Eigen::Vector2d& antenna, const State& before) {
  noise_.learn(declared.time_s, nis > LearntScale::kMedianNis ? 1.0 : 0.0);
  noise_.compare(track_.beside(declared.position, declared.covariance, antenna, std::sqrt(covariance_(kYaw, kYaw)),
                               parameters_.odometry.position_walk, declared.time_s));
  track_.correct(before.head<2>(), state_.head<2>());
  const double declared_m2 = 0.5 * declared.covariance.trace();
  common_variance_m2_ = parameters_.common_error.variance_m2(noise_.scale() * declared_m2, declared_m2);
}

PoseEstimate Ukf::estimate() const {
  PoseEstimate estimate{pose(), covariance_.topLeftCorner<3, 3>()};
  estimate.covariance.diagonal().head<2>().array() += common_variance_m2_;
  return estimate;
}

bool Ukf::is_settled_by_gate(const FixMeasurement& fix, const Eigen::Vector2d& innovation, FixOutcome& outcome) {
  if (parameters_.outliers != OutlierPolicy::kGate || outcome.nis <= nis_threshold_) {
    rejected_since_s_.reset();
    return false;
  }
  if (!rejected_since_s_) rejected_since_s_ = fix.time_s;
  if (fix.time_s - *rejected_since_s_ < parameters_.gate_timeout) {
    outcome.decision = FixDecision::kRejectedGate;
    return true;
  }
  // Locked out for so long: the estimate is wrong, not the fixes. All but the position is kept.
  State state = state_;
  state.head<2>() += innovation;
  Covariance covariance = covariance_;
  covariance.topRows<2>().setZero();
  covariance.leftCols<2>().setZero();
  covariance.topLeftCorner<2, 2>() = fix.covariance;
  if (!accept(state, covariance)) {
    outcome.decision = FixDecision::kRejectedDegenerate;
    return true;
  }
  rejected_since_s_.reset();
  noise_.learn(fix.time_s, 1.0);
  outcome.reason = "restarted on the fix after " + std::to_string(parameters_.gate_timeout) + " s of rejections";
  return true;
}

LocalizerHealth Ukf::health() const {
  LocalizerHealth health;
  health.heading_sigma_rad = std::sqrt(covariance_(kYaw, kYaw));
  health.position_spread_m = std::sqrt(covariance_.topLeftCorner<2, 2>().trace());
  return health;
}

}  // namespace urban_gnss
