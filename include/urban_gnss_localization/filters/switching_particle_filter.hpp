#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "urban_gnss_localization/filters/bias_modes.hpp"
#include "urban_gnss_localization/filters/particle_filter.hpp"
#include "urban_gnss_localization/filters/particle_localizer.hpp"

namespace urban_gnss {

/// What a particle of the switching filter knows of the fixes' bias, as arrays beside its pose.
struct BiasSet {
  std::vector<BiasMode> mode;    ///< at the last fix; lasts
  std::vector<double> x;         ///< m, mean of the bias
  std::vector<double> y;         ///< m
  std::vector<double> variance;  ///< m^2 per axis

  explicit BiasSet(std::size_t count) : mode(count), x(count), y(count), variance(count) {}
  BiasState bias(std::size_t i) const { return {{x[i], y[i]}, variance[i]}; }
};

/// One fix as the particles of the switching filter see it.
struct SwitchingFix {
  Eigen::Vector2d position{Eigen::Vector2d::Zero()};         ///< m, map frame
  Eigen::Vector2d antenna_in_body{Eigen::Vector2d::Zero()};  ///< m
  double direct_variance{1.0};                               ///< m^2 per axis
  double shadow_variance{1.0};                               ///< m^2 per axis, about the bias
  double elapsed_s{0.0};                                     ///< since the last fix
};

/// How a particle goes on from one fix to the next, and what it thereby says of the fix: the plain form, which the
/// filter's arrays must agree with (a test compares them).
struct ParticleContinuation {
  BiasMode mode{BiasMode::kDirect};
  bool is_outlier{false};
  BiasState bias;
  double log_likelihood{0.0};  ///< of the fix, over all continuations
};

/// Takes a fix (without outlier: a scalar Kalman step of the bias). `draw` in [0, 1) chooses the continuation with the
/// probability that it has after the fix.
ParticleContinuation continue_particle(const Pose2& pose, BiasMode mode, const BiasState& bias, const SwitchingFix& fix,
                                       const ModeTransition& transition, const BiasModeParameters& parameters,
                                       double draw);

/// The Rao-Blackwellized particle filter of a switching bias. A particle is a pose, the odometry's errors and a mode
/// (BiasMode); given these, its bias is Gaussian and known analytically: a mean and one variance.
///
/// At a fix each particle adds up the likelihoods of all its continuations: staying in or changing to each mode, with
/// the transition probabilities of the time since the last fix, and the fix being an outlier. The sum is its weight
/// (the optimal proposal for the mode); one continuation is drawn, and the bias updated by a scalar Kalman step. A
/// fix's covariance is taken for isotropic, with its mean variance.
///
/// Resampling is systematic, where the effective sample size is below half of the particles. It is regularised (Musso,
/// Oudjane and Le Gland 2001): copies are drawn apart by a Gaussian kernel, a small share of the heaviest cluster's
/// covariance of pose and odometry errors. Without it a few ancestors are all that is left of what hardly changes; the
/// odometry's errors do. A particle's bias makes up for the kernel's shift, as a fix sees the sum of both.
class SwitchingParticleFilter : public ParticleLocalizer {
 public:
  /// Requires parameters without faults.
  SwitchingParticleFilter(const ParticleFilterParameters& parameters, const MotionParameters& motion);

  const char* name() const override { return "particle_filter"; }
  std::string mode() const override { return enum_name(ParticleFilterMode::kSwitching); }
  bool wants_bias() const override { return false; }
  /// Throws std::invalid_argument where pose or covariance is not finite.
  void initialize(const PoseEstimate& start) override;
  /// Leaves out a step that is not finite or not positive in duration.
  void move(const Twist2& twist, double duration_s) override;
  /// kRejectedNonFinite for a fix that is not finite or has no positive definite covariance.
  FixVerdict correct(const FixMeasurement& fix) override;

  /// Prior odds of a bias for the next fixes, against those of the parameters: bias_odds of mode_transition().
  void set_bias_odds(double odds) { bias_odds_ = odds; }

  const BiasSet& biases() const { return biases_; }
  const OdometryErrorSet& odometry_errors() const { return errors_; }
  /// Weight of the particles in each mode.
  ModeProbabilities mode_probabilities() const;

 private:
  void continue_all(const SwitchingFix& fix);
  void examine(const FixMeasurement& fix, FixVerdict& verdict) const;
  /// Whether the fix is farther from what all particles together predict, their biases included, than half of the
  /// fixes are.
  bool is_beyond_median(const FixMeasurement& fix, double elapsed_s) const;
  void update_estimate();
  void resample();
  ParticleFilterParameters parameters_;
  MotionParameters motion_;
  double nis_threshold_;
  RandomEngine engine_;
  Resampler resampler_;
  BiasSet biases_;
  OdometryErrorSet errors_;
  OdometryErrors mean_errors_;  ///< at the last fix
  FixNoiseModel noise_;
  std::vector<BiasMode> modes_before_;    ///< scratch of resampling
  std::vector<std::uint8_t> is_outlier_;  ///< whether the particle took the last fix for one
  double bias_odds_{1.0};
  std::optional<double> last_fix_s_;
  double moved_s_{0.0};  ///< of odometry since the start
};

/// The particle filter of the mode that the parameters say.
std::unique_ptr<ParticleLocalizer> make_particle_filter(const ParticleFilterParameters& parameters,
                                                        const MotionParameters& motion);

}  // namespace urban_gnss
