#include "urban_gnss_localization/localizers/kim/complementary_ekf.hpp"

#include <Eigen/Dense>
#include <cmath>
#include <utility>

#include "urban_gnss_localization/gnss/chi_squared.hpp"

namespace urban_gnss {
namespace {

/// A heading with a larger standard deviation than this (rad) is unknown; that of a uniform one is 1.81.
constexpr double kUnknownHeading_rad = 1.5;
const Eigen::Matrix2d kBiasObservation = Eigen::Matrix2d::Identity();  // C: the bias adds to the fix

}  // namespace

ComplementaryEkf::ComplementaryEkf(const ComplementaryEkfParameters& parameters)
    : parameters_(parameters),
      odometry_(odometry_of_mode()),
      detector_(parameters.detector),
      noise_monitor_(parameters.fix_noise),
      close_threshold_(chi_squared_quantile(parameters.close_probability, kFixDof)),
      spike_threshold_(2.0 * detector_.threshold()),  // of two degrees of freedom: the false alarms of false alarms
      reacquisition_(parameters.reacquisition) {
  initialize({});
}

void ComplementaryEkf::initialize(const PoseEstimate& start) {
  pose_ = start.pose;
  dead_reckoned_ = start.pose;
  errors_ = {};
  filter_.set_state(ErrorState::Zero(), initial_error_covariance(start.covariance, odometry_));
  detector_.reset();
  noise_monitor_.reset();
  path_.setZero();
  path_variance_m2_ = 0.0;
  is_open_ = false;
  had_fix_ = false;
  reacquisition_.reset();
  common_variance_m2_ = 0.0;
  insignificant_ = 0;
  run_.reset();
  heading_search_.reset();
  if (start.covariance(2, 2) > kUnknownHeading_rad * kUnknownHeading_rad)
    heading_search_.emplace(HeadingInitializerParameters{});
  since_fix_ = {};
  last_test_covariance_.setZero();
  bias_estimates_.clear();
}

void ComplementaryEkf::move(const Twist2& twist, double duration_s) {
  const MotionStep motion = make_motion_step(twist, duration_s, parameters_.motion, odometry_);
  DeadReckoningStep step =
      dead_reckon(pose_, errors_, motion, odometry_, is_as_printed() ? StepPath::kTangent : StepPath::kChord);
  if (heading_search_) {
    // Which way it went is unknown: the position stays and becomes uncertain by the distance.
    const double distance_m = twist.ground_speed_mps() * duration_s;
    step.noise.topLeftCorner<2, 2>().diagonal().array() += distance_m * (distance_m + 2.0 * since_fix_.distance_m);
    step.transition.topRows<2>().rightCols<3>().setZero();
    step.pose.x = pose_.x;
    step.pose.y = pose_.y;
  }
  since_fix_.add(twist, duration_s);
  filter_.predict(step.transition * filter_.bias_free_state(), step.transition, step.noise);
  path_ += step.pose.position() - pose_.position();
  path_variance_m2_ += 0.5 * step.noise.topLeftCorner<2, 2>().trace();
  pose_ = step.pose;
  dead_reckoned_ = urban_gnss::move(dead_reckoned_, twist, duration_s);
}

void ComplementaryEkf::doubt(const MotionDoubt& doubt) {
  ErrorCovariance noise = ErrorCovariance::Zero();
  noise.diagonal().head<2>().setConstant(doubt.position_m2);
  noise(2, 2) = doubt.heading_rad2;
  filter_.predict(filter_.bias_free_state(), ErrorCovariance::Identity(), noise);
  path_variance_m2_ += doubt.position_m2;
}

void ComplementaryEkf::set_mode(ComplementaryMode mode) {
  if (mode == parameters_.mode) return;
  close();
  const bool was_as_printed = is_as_printed();
  parameters_.mode = mode;
  if (is_as_printed() == was_as_printed) return;
  odometry_ = odometry_of_mode();
  errors_ = {};
  filter_.set_state(ErrorState::Zero(),
                    initial_error_covariance(filter_.bias_free_covariance().topLeftCorner<3, 3>(), odometry_));
  common_variance_m2_ = 0.0;
}

FixOutcome ComplementaryEkf::correct(const FixMeasurement& fix) {
  const Eigen::Vector2d predicted = transform_point(pose_, fix.antenna_in_body);
  const Eigen::Vector2d lever = predicted - pose_.position();
  noise_monitor_.add(fix.position, fix.covariance, path_ + lever, path_variance_m2_,
                     std::sqrt(filter_.compensated_covariance().diagonal().segment<2>(2).sum()), fix.time_s);

  Innovation innovation;
  innovation.value = fix.position - predicted;
  innovation.observation.setZero();
  innovation.observation.leftCols<2>().setIdentity();
  innovation.observation.col(2) << -lever.y(), lever.x();
  innovation.declared = fix.covariance;
  if (!is_as_printed()) innovation.declared.diagonal().array() += reacquisition_.variance_m2(fix.time_s);
  reacquisition_.add(fix.time_s);
  innovation.noise = noise_inflation() * innovation.declared;
  innovation.time_s = fix.time_s;

  if (is_open_ && !is_as_printed()) {
    const double elapsed_s = std::max(0.0, fix.time_s - last_fix_s_);
    const double share = std::exp(-elapsed_s / parameters_.fix_bias_time);
    const double grown = parameters_.fix_bias_sigma * parameters_.fix_bias_sigma * (1.0 - share * share);
    filter_.fade_bias(share);
    filter_.grow_bias(grown * Eigen::Matrix2d::Identity());
  }
  if (run_ && fix.time_s - run_->last_s > parameters_.lockout_gap) run_.reset();

  FixOutcome outcome;
  if (heading_search_) {
    outcome.decision = FixDecision::kNotExamined;
    outcome.reason =
        search_heading(fix, innovation) ? "heading found from fixes and motion" : "used to find the heading";
  } else {
    decide(innovation, outcome);
  }
  last_fix_s_ = fix.time_s;
  had_fix_ = true;
  if (!is_as_printed()) {
    const double declared_m2 = 0.5 * fix.covariance.trace();
    common_variance_m2_ = parameters_.common_error.variance_m2(noise_monitor_.size() * declared_m2, declared_m2);
  }
  since_fix_ = {};
  publish(fix, predicted, outcome);
  return outcome;
}

double ComplementaryEkf::noise_inflation() const {
  if (is_as_printed()) return 1.0;
  double inflation = noise_monitor_.inflation();
  if (had_fix_ && parameters_.fix_noise.adapt_fix_noise) {
    // Errors that last for longer than the monitor's horizon, at the size that it has found.
    const double lasting = parameters_.errors.inflation(since_fix_.distance_m, since_fix_.duration_s);
    inflation = std::max(inflation, noise_monitor_.size() * lasting);
  }
  if (!since_fix_.is_standstill()) return inflation;
  // The mean of errors of correlation time tau over a time T has the variance 2 tau / T of one of them.
  return std::max(inflation, 2.0 * parameters_.parked_correlation_time / since_fix_.duration_s);
}

bool ComplementaryEkf::search_heading(const FixMeasurement& fix, const Innovation& innovation) {
  const Pose2 antenna{fix.antenna_in_body.x(), fix.antenna_in_body.y(), 0.0};
  heading_search_->add(compose(dead_reckoned_, antenna), {from_seconds(fix.time_s), fix.position, fix.covariance});
  std::optional<PoseEstimate> found = heading_search_->estimate();
  if (!found) {
    Innovation position_only = innovation;
    position_only.observation.col(2).setZero();
    apply(position_only);
    return false;
  }
  // The fixes that it was found from share an error that their scatter does not show.
  found->covariance.topLeftCorner<2, 2>() += fix.covariance;
  found->pose = compose(found->pose, inverse(antenna));
  initialize(*found);
  return true;
}

void ComplementaryEkf::decide(const Innovation& innovation, FixOutcome& outcome) {
  outcome.nis_dof = kFixDof;
  outcome.decision = FixDecision::kAccepted;
  if (is_as_printed()) {
    decide_as_printed(innovation, outcome);
    return;
  }
  const Eigen::Matrix2d covariance = prediction_covariance(innovation) + innovation.declared;
  last_test_covariance_ = covariance;
  outcome.nis_threshold = detector_.threshold();
  if (is_open_) {
    decide_open(innovation, outcome);
    return;
  }
  const BiasDetection detection = detector_.test(innovation.value, covariance);
  outcome.nis = detection.nis;
  if (parameters_.mode == ComplementaryMode::kStandard || !detection.is_biased()) {
    run_.reset();
    apply(innovation);
    return;
  }
  if (detection.is_ramp) outcome.reason = "the fixes drift away from the odometry";
  if (parameters_.mode == ComplementaryMode::kGated) {
    reject(innovation, outcome);
  } else {
    open_or_reject(innovation, outcome);
  }
}

void ComplementaryEkf::open_or_reject(const Innovation& innovation, FixOutcome& outcome) {
  const Eigen::Matrix2d m0 = initial_bias_covariance();
  const Eigen::Matrix2d covariance = prediction_covariance(innovation) + innovation.declared + m0;
  if (normalised_innovation_squared(innovation.value, covariance) > detector_.threshold()) {
    outcome.reason = "farther away than a bias explains";
    reject(innovation, outcome);
    return;
  }
  if (!is_open_) opened_s_ = innovation.time_s;
  open();
  is_confirmed_ = false;
  opening_nis_ = normalised_innovation_squared(innovation.value, covariance - m0);
  insignificant_ = 0;
  doubt(innovation);
  apply(innovation);
  outcome.decision = FixDecision::kBiasCompensated;
}

Eigen::Matrix2d ComplementaryEkf::initial_bias_covariance() const {
  return parameters_.fix_bias_sigma * parameters_.fix_bias_sigma * Eigen::Matrix2d::Identity();
}

void ComplementaryEkf::open() {
  filter_.open_bias(initial_bias_covariance());
  is_open_ = true;
}

void ComplementaryEkf::decide_open(const Innovation& innovation, FixOutcome& outcome) {
  const Eigen::Vector2d compensated = innovation.value - filter_.bias();
  outcome.nis = normalised_innovation_squared(
      compensated, filter_.innovation_covariance(innovation.observation, kBiasObservation, innovation.declared));
  const double direct =
      normalised_innovation_squared(innovation.value, prediction_covariance(innovation) + innovation.declared);
  if (!is_confirmed_ && is_false_alarm(innovation, direct, outcome)) return;
  if (outcome.nis <= detector_.threshold()) {
    is_confirmed_ = true;
    doubt(innovation);
    apply(innovation);
    outcome.decision = FixDecision::kBiasCompensated;
    close_if_insignificant(innovation, outcome);
    return;
  }
  // The bias has jumped: away, or to another.
  if (direct <= detector_.threshold()) {
    close();
    outcome.nis = direct;
    outcome.reason = "the bias has ended";
    apply(innovation);
    return;
  }
  open_or_reject(innovation, outcome);
}

bool ComplementaryEkf::is_false_alarm(const Innovation& innovation, double direct_nis, FixOutcome& outcome) {
  const Eigen::Matrix2d without = prediction_covariance(innovation) + innovation.declared;
  const Eigen::Matrix2d with =
      filter_.innovation_covariance(innovation.observation, kBiasObservation, innovation.declared);
  // Likelihood of the fix without a bias against that with the bias that the last fix showed.
  const bool speaks_for_none = direct_nis <= detector_.threshold() && direct_nis + std::log(without.determinant()) <
                                                                          outcome.nis + std::log(with.determinant());
  if (!speaks_for_none) return false;
  Innovation unbiased = innovation;
  if (opening_nis_ <= spike_threshold_) {
    filter_.discard_bias();  // the fix that raised the alarm counts after all
    unbiased.value -= innovation.observation * filter_.bias_free_state();
    feed_back();
    outcome.reason = "the bias was a false alarm";
  } else {
    outcome.reason = "the bias was a spike";
  }
  close();
  outcome.nis = direct_nis;
  apply(unbiased);
  return true;
}

void ComplementaryEkf::close_if_insignificant(const Innovation& innovation, FixOutcome& outcome) {
  insignificant_ = bias_statistic() <= close_threshold_ ? insignificant_ + 1 : 0;
  if (insignificant_ >= parameters_.close_count) {
    close();
    outcome.reason = "the bias has become insignificant";
  } else if (parameters_.lockout_policy == LockoutPolicy::kAutomatic &&
             innovation.time_s - opened_s_ > parameters_.bias_open_timeout) {
    Innovation next = innovation;
    next.value = filter_.bias();
    restart_position(next);
    outcome.reason = "position started anew on the fixes: the bias was significant for too long";
  }
}

void ComplementaryEkf::reject(const Innovation& innovation, FixOutcome& outcome) {
  doubt(innovation);
  outcome.decision = FixDecision::kRejectedGate;
  if (outcome.reason.empty()) outcome.reason = "innovation above its gate";
  if (parameters_.lockout_policy == LockoutPolicy::kAutomatic &&
      innovation.time_s - run_->since_s >= parameters_.lockout_timeout) {
    restart_position(innovation);
    outcome.decision = FixDecision::kInflated;
    outcome.reason = "position started anew on the fixes after nothing but rejections";
  }
}

void ComplementaryEkf::restart_position(const Innovation& innovation) {
  close();
  ErrorCovariance covariance = filter_.compensated_covariance();
  // As uncertain as the fix shows it to be wrong; heading and odometry errors are kept.
  covariance.topLeftCorner<2, 2>() += innovation.value * innovation.value.transpose();
  filter_.set_state(ErrorState::Zero(), covariance);
  apply(innovation);
  run_.reset();
  detector_.reset();
}

void ComplementaryEkf::close() {
  filter_.close_bias();
  is_open_ = false;
  insignificant_ = 0;
  run_.reset();
  detector_.reset();
}

void ComplementaryEkf::apply(const Innovation& innovation) {
  filter_.correct(innovation.value - innovation.observation * filter_.bias_free_state(), innovation.observation,
                  kBiasObservation, innovation.noise);
  feed_back();
}

void ComplementaryEkf::feed_back() {
  const ErrorState error = filter_.compensated_state();
  pose_ = {pose_.x + error(0), pose_.y + error(1), wrap_angle(pose_.yaw + error(2))};
  errors_.speed_scale += error(3);
  errors_.yaw_rate_bias_radps += error(4);
  filter_.shift_origin(error);
}

Eigen::Matrix2d ComplementaryEkf::prediction_covariance(const Innovation& innovation) const {
  if (run_ && run_->is_frozen) return run_->covariance;
  return innovation.observation * filter_.compensated_covariance() * innovation.observation.transpose();
}

void ComplementaryEkf::doubt(const Innovation& innovation) {
  if (!run_) run_ = Run{innovation.time_s, innovation.time_s, Eigen::Matrix2d::Zero(), false};
  if (!run_->is_frozen && innovation.time_s - run_->since_s >= parameters_.detection_horizon) {
    run_->covariance = prediction_covariance(innovation);
    run_->is_frozen = true;
  }
  run_->last_s = innovation.time_s;
}

double ComplementaryEkf::bias_statistic() const {
  return is_open_ ? normalised_innovation_squared(filter_.bias(), filter_.bias_covariance()) : 0.0;
}

double ComplementaryEkf::smallest_detectable_jump_m() const {
  if (!had_fix_) return 0.0;
  return urban_gnss::smallest_detectable_jump(last_test_covariance_, parameters_.detector.gate_probability);
}

PoseEstimate ComplementaryEkf::estimate() const {
  PoseEstimate estimate{pose_, filter_.compensated_covariance().topLeftCorner<3, 3>()};
  estimate.covariance.diagonal().head<2>().array() += common_variance_m2_;
  return estimate;
}

LocalizerHealth ComplementaryEkf::health() const {
  LocalizerHealth health;
  health.heading_sigma_rad = std::sqrt(filter_.compensated_covariance()(2, 2));
  health.bias_radius_m = bias().norm();
  return health;
}

void ComplementaryEkf::publish(const FixMeasurement& fix, const Eigen::Vector2d& predicted, const FixOutcome& outcome) {
  constexpr std::size_t kMostKept = 1000;  // where nobody takes them
  BiasEstimate estimate;
  estimate.stamp = fix.stamp;
  estimate.bias = filter_.bias();
  estimate.covariance = filter_.bias_covariance();
  estimate.radius_m = estimate.bias.norm();
  estimate.shadow_statistic = bias_statistic();
  estimate.shadow_threshold = close_threshold_;
  estimate.in_shadow = estimate.shadow_statistic > close_threshold_;
  estimate.fix_position = fix.position;
  estimate.predicted_antenna_position = predicted;
  estimate.outcome = outcome;
  estimate.outcome.stamp = fix.stamp;
  if (bias_estimates_.size() >= kMostKept) bias_estimates_.erase(bias_estimates_.begin());
  bias_estimates_.push_back(std::move(estimate));
}

std::vector<BiasEstimate> ComplementaryEkf::take_bias_estimates() { return std::exchange(bias_estimates_, {}); }

}  // namespace urban_gnss
