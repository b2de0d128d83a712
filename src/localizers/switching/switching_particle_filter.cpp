#include "urban_gnss_localization/localizers/switching/switching_particle_filter.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "urban_gnss_localization/gnss/chi_squared.hpp"

namespace urban_gnss {
namespace {

constexpr int kYaw = 2;
constexpr double kReportedQuantile = 0.99;
/// Standard deviations within which particles belong to the cluster of a heavier one.
constexpr double kClusterSigmas = 3.0;
constexpr BiasMode kModes[kContinuations] = {BiasMode::kDirect, BiasMode::kSlow, BiasMode::kFast, BiasMode::kJump};

/// Cuts a start whose heading is too uncertain for a linearisation into up to `most` slices of headings, all over the
/// circle where it is not known at all.
void slice_heading(const BiasGaussian& start, std::size_t most, std::vector<BiasHypothesis>& slices) {
  const double variance = start.covariance(kYaw, kYaw);
  const double sigma = std::sqrt(variance);
  const std::size_t count = sigma > MixtureReducer::kSameHeading ? std::max<std::size_t>(most, 1) : 1;
  if (count == 1) {
    slices.push_back({start, BiasMode::kDirect, 0, 1.0});
    return;
  }
  const bool is_unknown = variance >= kPi * kPi / 3.0;
  const double half_range = is_unknown ? kPi : std::min(3.0 * sigma, kPi);
  const double width = 2.0 * half_range / static_cast<double>(count);
  const double left = std::min(width * width, variance);  // variance of a slice, which overlaps with those beside it
  const BiasEkfState with_yaw = start.covariance.col(kYaw) / variance;
  BiasHypothesis slice{start, BiasMode::kDirect, 0, 0.0};
  slice.state.covariance -= (variance - left) * with_yaw * with_yaw.transpose();
  double sum = 0.0;
  for (std::size_t k = 0; k < count; ++k) {
    const double offset = (static_cast<double>(k) + 0.5) * width - half_range;
    slice.state.mean = start.mean + offset * with_yaw;
    slice.state.mean[kYaw] = wrap_angle(slice.state.mean[kYaw]);
    sum += slice.weight = is_unknown ? 1.0 : std::exp(-0.5 * offset * offset / variance);
    slices.push_back(slice);
  }
  for (BiasHypothesis& each : slices) each.weight /= sum;
}

/// Each hypothesis once for each quality of the odometry.
void spread_quality(const QualityProbabilities& prior, std::vector<BiasHypothesis>& hypotheses) {
  const std::size_t count = hypotheses.size();
  for (std::size_t level = kQualityLevels; level-- > 0;) {
    for (std::size_t i = 0; i < count; ++i) {
      BiasHypothesis each = hypotheses[i];
      each.quality = level;
      each.weight *= prior[static_cast<int>(level)];
      if (level > 0) {
        hypotheses.push_back(each);
      } else {
        hypotheses[i] = each;
      }
    }
  }
}

QualityProbabilities quality_of(const std::vector<BiasHypothesis>& hypotheses) {
  QualityProbabilities sums = QualityProbabilities::Zero();
  for (const BiasHypothesis& each : hypotheses) sums[static_cast<int>(each.quality)] += each.weight;
  return sums;
}

/// Weighs those of each quality so that they sum to `target`.
void set_quality(const QualityProbabilities& target, std::vector<BiasHypothesis>& hypotheses) {
  const QualityProbabilities factors = rescaling(quality_of(hypotheses), target);
  double sum = 0.0;
  for (BiasHypothesis& each : hypotheses) sum += each.weight *= factors[static_cast<int>(each.quality)];
  for (BiasHypothesis& each : hypotheses) each.weight /= sum;  // a quality may have died out
}

}  // namespace

SwitchingParticleFilter::SwitchingParticleFilter(const SwitchingParticleFilterParameters& parameters,
                                                 const MotionParameters& motion)
    : ParticleLocalizer(0),
      parameters_(parameters),
      motion_(motion),
      nis_threshold_(chi_squared_quantile(kReportedQuantile, kFixDof)),
      most_(static_cast<std::size_t>(parameters.max_particles)),
      statistics_(parameters.model),
      levels_(quality_levels(parameters.model.odometry, parameters.model.quality)),
      reducer_(kContinuations * kQualityLevels * capacity()) {
  particles_ = ParticleSet(capacity());
  hypotheses_.reserve(kContinuations * kQualityLevels * capacity());
  next_.reserve(kContinuations * kQualityLevels * capacity());
  updates_.reserve(kContinuations * kQualityLevels * capacity());
  cluster_.reserve(capacity());
  cluster_mass_.reserve(capacity());
  draws_.reserve(capacity());
  initialize({});
}

void SwitchingParticleFilter::initialize(const PoseEstimate& start) {
  if (!is_finite(start.pose) || !start.covariance.allFinite()) {
    throw std::invalid_argument("switching_particle_filter: the pose to start from is not finite");
  }
  engine_ = make_engine(static_cast<std::uint64_t>(parameters_.seed));
  hypotheses_.clear();
  slice_heading(start_gaussian(start, parameters_.model), most_ / kQualityLevels, hypotheses_);
  spread_quality(prior_quality(parameters_.model.quality), hypotheses_);
  statistics_.reset();
  draw_cloud();
  find_clusters();
}

void SwitchingParticleFilter::move(const Twist2& twist, double duration_s) {
  if (!is_usable(twist, duration_s)) return;
  statistics_.move(twist, duration_s);
  const std::array<MotionStep, kQualityLevels> steps = make_motion_steps(twist, duration_s, motion_, levels_);
  for (BiasHypothesis& each : hypotheses_) predict(each.state, steps[each.quality], levels_[each.quality]);
  update_estimate();
}

void SwitchingParticleFilter::doubt(const MotionDoubt& doubt) {
  for (BiasHypothesis& each : hypotheses_) urban_gnss::doubt(each.state, doubt);
  update_estimate();
}

bool SwitchingParticleFilter::continue_all(const FixMeasurement& fix, Opinion& opinion) {
  const double elapsed_s = statistics_.elapsed_s(fix.time_s);
  const FixNoise noise = statistics_.fix_noise(fix.time_s);
  const ModeTransition transition = mode_transition(elapsed_s, parameters_.model.modes, statistics_.bias_odds());
  const QualityTransition quality = quality_transition(elapsed_s, parameters_.model.quality);
  const BiasSteps steps = bias_steps(elapsed_s, parameters_.model.modes);
  next_.clear();
  for (const BiasHypothesis& before : hypotheses_) {
    for (const BiasMode to : kModes) {
      BiasGaussian state = before.state;
      continue_bias(state, steps[index_of(before.mode)][index_of(to)]);
      const double weight =
          before.weight * transition(static_cast<int>(index_of(before.mode)), static_cast<int>(index_of(to)));
      for (std::size_t level = 0; level < kQualityLevels; ++level) {
        next_.push_back(
            {state, to, level, weight * quality(static_cast<int>(before.quality), static_cast<int>(level))});
      }
    }
  }
  const QualityProbabilities expected = quality_of(next_);
  reducer_.merge(next_, parameters_.merge_distance);
  updates_.clear();
  double largest = -std::numeric_limits<double>::infinity();
  for (BiasHypothesis& next : next_) {
    updates_.push_back(take_fix(next.state, next.mode, fix, noise, parameters_.model));
    next.mode = lasting(next.mode);
    next.weight = std::log(next.weight) + updates_.back().log_likelihood;
    if (!next.state.is_finite() || std::isnan(next.weight)) next.weight = -std::numeric_limits<double>::infinity();
    largest = std::max(largest, next.weight);
  }
  if (!std::isfinite(largest)) return false;
  double sum = 0.0;
  for (BiasHypothesis& next : next_) sum += next.weight = std::exp(next.weight - largest);
  for (std::size_t i = 0; i < next_.size(); ++i) {
    next_[i].weight /= sum;
    opinion.outlier += next_[i].weight * updates_[i].outlier;
    if (updates_[i].white_nis > LearntScale::kMedianNis) opinion.exceeding += next_[i].weight;
  }
  set_quality(bounded_quality(expected, quality_of(next_), parameters_.model.quality), next_);
  return true;
}

FixOutcome SwitchingParticleFilter::correct(const FixMeasurement& declared) {
  FixOutcome outcome;
  if (!is_usable(declared)) {
    outcome.decision = FixDecision::kRejectedNonFinite;
    outcome.reason = "position, time or covariance cannot be used";
    return outcome;
  }
  const PoseEstimate before = mixture().pose_estimate();
  const FixMeasurement fix = statistics_.effective_fix(declared, before);
  outcome.of_ranges = statistics_.of_ranges();
  const Eigen::Vector2d innovation = fix.position - transform_point(estimate_, fix.antenna_in_body);
  const Eigen::Matrix2d covariance =
      before.covariance.topLeftCorner<2, 2>() + parameters_.model.fix.direct_covariance(fix.covariance);
  outcome.nis = innovation.dot(covariance.inverse() * innovation);
  outcome.nis_dof = kFixDof;
  outcome.nis_threshold = nis_threshold_;
  Opinion opinion;
  if (!continue_all(fix, opinion)) {
    outcome.decision = FixDecision::kRejectedDegenerate;
    outcome.reason = "no particle can take the fix";
    return outcome;
  }
  reducer_.select(next_, most_, engine_);
  hypotheses_.swap(next_);
  statistics_.learn_fix(fix.time_s, opinion.exceeding);
  statistics_.compare_with_odometry(fix, before, mixture().pose());
  draw_cloud();
  find_clusters();

  outcome.decision = mode_probabilities()[0] >= 0.5 ? FixDecision::kAccepted : FixDecision::kBiasCompensated;
  if (opinion.outlier > 0.5) {
    outcome.decision = FixDecision::kInflated;
    outcome.reason = "outlier, probability " + std::to_string(opinion.outlier);
  }
  return outcome;
}

void SwitchingParticleFilter::correct_velocity(const VelocityMeasurement& measured) {
  if (!is_usable(measured)) return;
  const Eigen::Matrix2d noise = statistics_.velocity_scale() * measured.covariance;
  const double inflation = statistics_.velocity_inflation(measured.time_s);
  next_ = hypotheses_;
  double exceeding = 0.0;
  double largest = -std::numeric_limits<double>::infinity();
  for (BiasHypothesis& next : next_) {
    const BiasEkfUpdate update =
        take_velocity(next.state, measured, noise, inflation, parameters_.model.velocity.velocity_dof);
    if (!next.state.is_finite() || std::isnan(update.log_likelihood)) return;
    if (update.white_nis > LearntScale::kMedianNis) exceeding += next.weight;
    next.weight = std::log(next.weight) + update.log_likelihood;
    largest = std::max(largest, next.weight);
  }
  if (!std::isfinite(largest)) return;
  double sum = 0.0;
  for (BiasHypothesis& next : next_) sum += next.weight = std::exp(next.weight - largest);
  for (BiasHypothesis& next : next_) next.weight /= sum;
  set_quality(quality_of(hypotheses_), next_);  // errors of velocities last, and look like a heading that wanders
  const Pose2 before = mixture().pose();
  hypotheses_.swap(next_);
  statistics_.learn_velocity(measured.time_s, exceeding, before, mixture().pose());
  find_clusters();
}

void SwitchingParticleFilter::draw_cloud() {
  draws_.clear();
  for (std::size_t i = 0; i < hypotheses_.size(); ++i) {
    const double x = draw_normal(engine_);
    const double y = draw_normal(engine_);
    draws_.emplace_back(x, y, draw_normal(engine_));
  }
}

void SwitchingParticleFilter::find_clusters() {
  // The heaviest are first, but for what a velocity has changed.
  const std::size_t count = hypotheses_.size();
  constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();
  cluster_.assign(count, kNone);
  cluster_mass_.clear();
  const double cell2 = parameters_.cluster_cell * parameters_.cluster_cell;
  for (std::size_t centre = 0; centre < count; ++centre) {
    if (cluster_[centre] != kNone) continue;
    const auto cluster = static_cast<std::uint32_t>(cluster_mass_.size());
    cluster_mass_.push_back(0.0);
    const BiasGaussian& middle = hypotheses_[centre].state;
    for (std::size_t i = centre; i < count; ++i) {
      if (cluster_[i] != kNone) continue;
      const BiasGaussian& state = hypotheses_[i].state;
      const Eigen::Vector2d apart = state.mean.head<2>() - middle.mean.head<2>();
      const Eigen::Matrix2d covariance = state.covariance.topLeftCorner<2, 2>() +
                                         middle.covariance.topLeftCorner<2, 2>() + cell2 * Eigen::Matrix2d::Identity();
      if (i != centre && apart.dot(covariance.inverse() * apart) > kClusterSigmas * kClusterSigmas) continue;
      cluster_[i] = cluster;
      cluster_mass_.back() += hypotheses_[i].weight;
    }
  }
  heaviest_ =
      static_cast<std::uint32_t>(std::max_element(cluster_mass_.begin(), cluster_mass_.end()) - cluster_mass_.begin());
  double squares = 0.0;
  for (const BiasHypothesis& each : hypotheses_) squares += each.weight * each.weight;
  effective_sample_size_ = 1.0 / squares;
  update_estimate();
}

void SwitchingParticleFilter::update_estimate() {
  const bool is_of_all = parameters_.estimate == EstimateMethod::kMean;
  Eigen::Vector4d sums = Eigen::Vector4d::Zero();
  double mass = 0.0;
  for (std::size_t i = 0; i < hypotheses_.size(); ++i) {
    if (!is_of_all && cluster_[i] != heaviest_) continue;
    const BiasHypothesis& each = hypotheses_[i];
    sums += each.weight * Eigen::Vector4d(each.state.mean[0], each.state.mean[1], std::cos(each.state.mean[kYaw]),
                                          std::sin(each.state.mean[kYaw]));
    mass += each.weight;
  }
  estimate_ = {sums[0] / mass, sums[1] / mass, std::atan2(sums[3], sums[2])};

  particles_.resize(hypotheses_.size());
  particles_.origin = estimate_.position();
  for (std::size_t i = 0; i < hypotheses_.size(); ++i) {
    const BiasGaussian& state = hypotheses_[i].state;
    const Eigen::LLT<Eigen::Matrix3d> root(state.covariance.topLeftCorner<3, 3>());
    const Eigen::Vector3d offset =
        root.info() == Eigen::Success ? Eigen::Vector3d(root.matrixL() * draws_[i]) : Eigen::Vector3d::Zero().eval();
    particles_.set_pose(
        i, {state.mean[0] + offset[0], state.mean[1] + offset[1], wrap_angle(state.mean[kYaw] + offset[kYaw])});
    particles_.weight[i] = hypotheses_[i].weight;
    particles_.log_weight[i] = std::log(hypotheses_[i].weight);
  }
}

PoseEstimate SwitchingParticleFilter::estimate() const {
  PoseEstimate estimate{estimate_, Eigen::Matrix3d::Zero()};
  for (const BiasHypothesis& each : hypotheses_) {
    const Eigen::Vector3d apart(each.state.mean[0] - estimate_.x, each.state.mean[1] - estimate_.y,
                                angle_difference(each.state.mean[kYaw], estimate_.yaw));
    estimate.covariance += each.weight * (each.state.covariance.topLeftCorner<3, 3>() + apart * apart.transpose());
  }
  estimate.covariance.diagonal().head<2>().array() += statistics_.common_variance_m2();
  return estimate;
}

LocalizerHealth SwitchingParticleFilter::health() const {
  LocalizerHealth health;
  double cosine = 0.0;
  double sine = 0.0;
  for (const BiasHypothesis& each : hypotheses_) {
    const double length = each.weight * std::exp(-0.5 * each.state.covariance(kYaw, kYaw));
    cosine += length * std::cos(each.state.mean[kYaw]);
    sine += length * std::sin(each.state.mean[kYaw]);
  }
  health.heading_sigma_rad = std::sqrt(-2.0 * std::log(std::min(1.0, std::hypot(cosine, sine))));
  health.particle_count = static_cast<std::uint32_t>(hypotheses_.size());
  health.effective_sample_size = effective_sample_size_;
  health.position_spread_m = std::sqrt(mixture().covariance.topLeftCorner<2, 2>().trace());
  health.cluster_mass = cluster_mass_[heaviest_];
  health.cluster_count = static_cast<std::uint32_t>(cluster_mass_.size());
  return health;
}

BiasGaussian SwitchingParticleFilter::mixture() const {
  return match_moments(
      hypotheses_.size(), [this](std::size_t i) -> const BiasGaussian& { return hypotheses_[i].state; },
      [this](std::size_t i) { return hypotheses_[i].weight; });
}

ModeProbabilities SwitchingParticleFilter::mode_probabilities() const {
  ModeProbabilities probabilities = ModeProbabilities::Zero();
  for (const BiasHypothesis& each : hypotheses_) {
    probabilities[static_cast<int>(index_of(each.mode))] += each.weight;
  }
  return probabilities;
}

}  // namespace urban_gnss
