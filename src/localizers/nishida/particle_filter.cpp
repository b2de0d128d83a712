#include "urban_gnss_localization/localizers/nishida/particle_filter.hpp"

#include <Eigen/Dense>
#include <cmath>

#include "urban_gnss_localization/gnss/chi_squared.hpp"

namespace urban_gnss {

EnumNames<LikelihoodChoice> enum_names(LikelihoodChoice) {
  return {{"auto", LikelihoodChoice::kAuto},
          {"printed", LikelihoodChoice::kPrinted},
          {"sum", LikelihoodChoice::kSum},
          {"product", LikelihoodChoice::kProduct}};
}

EnumNames<Switch> enum_names(Switch) {
  return {{"auto", Switch::kAuto}, {"always", Switch::kAlways}, {"never", Switch::kNever}};
}

EnumNames<EstimateChoice> enum_names(EstimateChoice) {
  return {{"auto", EstimateChoice::kAuto},
          {"mean", EstimateChoice::kMean},
          {"heaviest_cluster", EstimateChoice::kHeaviestCluster}};
}

void ParticleFilterParameters::check(std::vector<std::string>& faults) const {
  if (ess_threshold > particle_count) {
    faults.push_back("ess_threshold = " + std::to_string(ess_threshold) +
                     ": must not exceed particle_count = " + std::to_string(particle_count));
  }
}

LikelihoodForm ParticleFilterParameters::likelihood_form() const {
  switch (likelihood) {
    case LikelihoodChoice::kPrinted: return LikelihoodForm::kPrinted;
    case LikelihoodChoice::kSum: return LikelihoodForm::kSum;
    case LikelihoodChoice::kProduct: return LikelihoodForm::kProduct;
    case LikelihoodChoice::kAuto: break;
  }
  return mode == ParticleFilterMode::kPaper ? LikelihoodForm::kProduct : LikelihoodForm::kPrinted;
}

bool ParticleFilterParameters::uses_gps_heading() const {
  if (use_gps_heading != Switch::kAuto) return use_gps_heading == Switch::kAlways;
  return likelihood_form() != LikelihoodForm::kProduct;
}

bool ParticleFilterParameters::averages_all() const {
  return estimate == EstimateChoice::kMean || (estimate == EstimateChoice::kAuto && mode != ParticleFilterMode::kPaper);
}

bool ParticleFilterParameters::is_as_printed() const {
  return mode != ParticleFilterMode::kPaper && likelihood_form() == LikelihoodForm::kPrinted;
}

ParticleFilter::ParticleFilter(const ParticleFilterParameters& parameters, const MotionParameters& motion)
    : ParticleLocalizer(static_cast<std::size_t>(parameters.particle_count)),
      parameters_(parameters),
      motion_(motion),
      nis_threshold_(chi_squared_quantile(std::min(parameters.gate_probability, 1.0 - 1e-12), kFixDof)),
      clusters_(particles_.size(), parameters.cluster_cell),
      ring_(particles_.size(), parameters.mode == ParticleFilterMode::kConventional ? 0.0 : parameters.ring_share),
      resampler_(particles_.size(), parameters.resampling) {
  initialize({});
}

void ParticleFilter::initialize(const PoseEstimate& start) {
  engine_ = make_engine(static_cast<std::uint64_t>(parameters_.seed));
  particles_.draw_gaussian(start, engine_);
  ring_.reset();
  estimate_ = start.pose;
  last_fix_position_ = start.pose.position();
  turn_since_fix_ = 0.0;
  had_fix_ = false;
  clusters_.find(particles_);
  effective_sample_size_ = urban_gnss::effective_sample_size(particles_);
}

void ParticleFilter::move(const Twist2& twist, double duration_s) {
  sample_motion(particles_, make_motion_step(twist, duration_s, motion_), next_stream());
  estimate_ = urban_gnss::move(estimate_, twist, duration_s);
  particles_.recentre(estimate_.position());
  turn_since_fix_ += twist.yaw_rate_radps * duration_s;
}

void ParticleFilter::doubt(const MotionDoubt& doubt) {
  particles_.spread(doubt.position_m2, doubt.heading_rad2, engine_);
}

FixOutcome ParticleFilter::correct(const FixMeasurement& fix) {
  FixOutcome outcome;
  examine(fix, outcome);
  if (is_gated(fix, outcome)) return outcome;
  last_accepted_time_s_ = fix.time_s;
  had_fix_ = true;

  // Sample: the motion has been drawn by move(); what is left of (22) is the ring.
  ring_.sample(particles_, estimate_, fix.bias_radius_m, parameters_.fix.direct_sigma, parameters_.fix.shadow_sigma,
               next_stream());

  // Weigh.
  weigh(particles_, likelihood_of(fix));
  if (!particles_.normalise()) {
    outcome.decision = FixDecision::kRejectedDegenerate;
    outcome.reason = "no particle has a usable weight; weights set equal";
  }

  // Estimate.
  effective_sample_size_ = urban_gnss::effective_sample_size(particles_);
  estimate_ = posterior_mean();
  last_fix_position_ = transform_point(estimate_, fix.antenna_in_body);
  turn_since_fix_ = 0.0;

  // Resample.
  if (effective_sample_size_ < parameters_.ess_threshold) resampler_.resample(particles_, next_stream());
  return outcome;
}

void ParticleFilter::examine(const FixMeasurement& fix, FixOutcome& outcome) const {
  const Eigen::Matrix2d spread = covariance_about(particles_, circular_mean(particles_)).topLeftCorner<2, 2>();
  const Eigen::Vector2d innovation = fix.position - transform_point(estimate_, fix.antenna_in_body);
  outcome.nis = innovation.dot((spread + fix.covariance).ldlt().solve(innovation));
  outcome.nis_dof = kFixDof;
  outcome.nis_threshold = nis_threshold_;
  outcome.decision = FixDecision::kAccepted;
  // The proposed filter does not turn away a fix that direct reception cannot explain: the ring explains it.
  if (wants_bias() && outcome.nis > nis_threshold_) outcome.decision = FixDecision::kBiasCompensated;
}

bool ParticleFilter::is_gated(const FixMeasurement& fix, FixOutcome& outcome) {
  if (!gates() || outcome.nis <= nis_threshold_) return false;
  if (!had_fix_) {
    had_fix_ = true;
    last_accepted_time_s_ = fix.time_s;
  }
  if (fix.time_s - last_accepted_time_s_ < parameters_.gate_timeout) {
    outcome.decision = FixDecision::kRejectedGate;
    return true;
  }
  // Locked out for so long: the particles are wrong, not the fixes. The heading is kept.
  PoseEstimate restart = estimate();
  const Eigen::Vector2d shift = fix.position - transform_point(estimate_, fix.antenna_in_body);
  restart.pose.x += shift.x();
  restart.pose.y += shift.y();
  restart.covariance.topLeftCorner<2, 2>() = fix.covariance;
  restart.covariance.topRightCorner<2, 1>().setZero();
  restart.covariance.bottomLeftCorner<1, 2>().setZero();
  particles_.draw_gaussian(restart, engine_);
  estimate_ = restart.pose;
  outcome.reason = "restarted on the fix after " + std::to_string(parameters_.gate_timeout) + " s of rejections";
  return false;
}

FixLikelihood ParticleFilter::likelihood_of(const FixMeasurement& fix) const {
  FixLikelihood likelihood;
  likelihood.form = parameters_.likelihood_form();
  likelihood.with_shadow = wants_bias();
  likelihood.with_heading = parameters_.uses_gps_heading();
  likelihood.fix = fix.position;
  likelihood.antenna_in_body = fix.antenna_in_body;
  FixSigmaParameters sigma = parameters_.fix;
  if (parameters_.is_as_printed()) sigma.use_fix_covariance = false;
  likelihood.direct_covariance = sigma.direct_covariance(fix.covariance);
  likelihood.shadow_sigma = parameters_.fix.shadow_sigma;
  likelihood.heading_sigma = parameters_.gps_heading_sigma;
  likelihood.radius = fix.bias_radius_m;
  likelihood.fix_heading = fix_heading(fix.position, last_fix_position_, turn_since_fix_);
  return likelihood;
}

Pose2 ParticleFilter::posterior_mean() {
  clusters_.find(particles_);
  if (!parameters_.averages_all()) return clusters_.heaviest_mean(particles_);
  return parameters_.is_as_printed() ? arithmetic_mean(particles_) : circular_mean(particles_);
}

LocalizerHealth ParticleFilter::health() const {
  LocalizerHealth health;
  health.heading_sigma_rad = circular_sigma(particles_);
  health.particle_count = static_cast<std::uint32_t>(particles_.size());
  health.effective_sample_size = effective_sample_size_;
  health.position_spread_m =
      std::sqrt(covariance_about(particles_, circular_mean(particles_)).topLeftCorner<2, 2>().trace());
  health.cluster_mass = clusters_.heaviest_mass();
  health.cluster_count = clusters_.count();
  return health;
}

}  // namespace urban_gnss
