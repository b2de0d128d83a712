#pragma once

#include <cstdint>

#include "urban_gnss_localization/localizers/switching/bias_ekf.hpp"
#include "urban_gnss_localization/localizers/nishida/estimation.hpp"
#include "urban_gnss_localization/localizers/nishida/fix_likelihood.hpp"
#include "urban_gnss_localization/localizers/particle_localizer.hpp"
#include "urban_gnss_localization/localizers/nishida/resampling.hpp"
#include "urban_gnss_localization/localizers/nishida/sampling.hpp"

namespace urban_gnss {

enum class ParticleFilterMode {
  kLiteral,       ///< the text as printed
  kPaper,         ///< its reading that works
  kConventional,  ///< eq. (46), (47): motion proposal, direct likelihood
  kSwitching,     ///< no mode of ParticleFilter: SwitchingParticleFilter
};
EnumNames<ParticleFilterMode> enum_names(ParticleFilterMode);

/// A choice that the mode makes unless it is made explicitly.
enum class LikelihoodChoice { kAuto, kPrinted, kSum, kProduct };
enum class Switch { kAuto, kAlways, kNever };  // YAML 1.1 reads "on" and "off" as booleans
enum class EstimateMethod { kMean, kHeaviestCluster };
EnumNames<LikelihoodChoice> enum_names(LikelihoodChoice);
EnumNames<Switch> enum_names(Switch);
EnumNames<EstimateMethod> enum_names(EstimateMethod);

struct ParticleFilterParameters {
  ParticleFilterMode mode{ParticleFilterMode::kPaper};
  int particle_count{1000};                              ///< M
  double ring_share{0.05};                               ///< share of particles drawn on the ring, eq. (22)
  LikelihoodChoice likelihood{LikelihoodChoice::kAuto};  ///< auto: printed (literal, conventional) or product (paper)
  Switch use_gps_heading{Switch::kAuto};  ///< theta_GPS, eq. (12); auto: with the sums, not with the product
  double gps_heading_sigma{0.1};          ///< rad, sigma_p
  double ess_threshold{5.0};              ///< resampling below this effective sample size, eq. (39)
  ResamplingScheme resampling{ResamplingScheme::kMultinomial};
  EstimateMethod estimate{EstimateMethod::kHeaviestCluster};
  double cluster_cell{1.0};       ///< m, particles within one to two cells belong together
  double gate_probability{0.99};  ///< conventional mode: gate on the NIS; 1 switches it off
  double gate_timeout{5.0};       ///< s of nothing but rejections after which it restarts on the fix
  int seed{1};
  int max_particles{100};          ///< of the mode switching, whose number adapts itself
  double merge_distance{0.5};      ///< of the mode switching: particles nearer than this become one; large: imm_ekf
  SwitchingModelParameters model;  ///< of the mode switching; its sigma_b, sigma_s are those of all

  template <class V>
  void visit(V& v) {
    v("mode", mode);
    v("particle_count", particle_count, between(1, 1000000));
    v("ring_share", ring_share, between(0.0, 1.0));
    v("likelihood", likelihood);
    v("use_gps_heading", use_gps_heading);
    v("gps_heading_sigma", gps_heading_sigma, positive());
    v("ess_threshold", ess_threshold, non_negative());
    v("resampling", resampling);
    v("estimate", estimate);
    v("cluster_cell", cluster_cell, positive());
    v("gate_probability", gate_probability, Range{0.0, 1.0, true});
    v("gate_timeout", gate_timeout, positive());
    v("seed", seed, any_number());
    v("max_particles", max_particles, between(1, 10000));
    v("merge_distance", merge_distance, non_negative());
    model.visit(v);
  }
  void check(std::vector<std::string>& faults) const;

  /// What `auto` stands for in this mode.
  LikelihoodForm likelihood_form() const;
  bool uses_gps_heading() const;
};

/// The particle filter of Nishida et al., Algorithm 1: sample, weigh, estimate, resample.
class ParticleFilter : public ParticleLocalizer {
 public:
  /// Requires parameters without faults, and another mode than kSwitching.
  ParticleFilter(const ParticleFilterParameters& parameters, const MotionParameters& motion);

  const char* name() const override { return "particle_filter"; }
  std::string mode() const override { return enum_name(parameters_.mode); }
  bool wants_bias() const override { return parameters_.mode != ParticleFilterMode::kConventional; }
  void initialize(const PoseEstimate& start) override;
  void move(const Twist2& twist, double duration_s) override;
  FixVerdict correct(const FixMeasurement& fix) override;
  /// The covariance is that of all particles about the pose, other clusters included.
  PoseEstimate estimate() const override { return {estimate_, covariance_about(particles_, estimate_)}; }
  LocalizerHealth health() const override;

 private:
  FixLikelihood likelihood_of(const FixMeasurement& fix) const;
  Pose2 posterior_mean();
  void examine(const FixMeasurement& fix, FixVerdict& verdict) const;
  bool is_gated(const FixMeasurement& fix, FixVerdict& verdict);

  ParticleFilterParameters parameters_;
  MotionParameters motion_;
  double nis_threshold_;
  RandomEngine engine_;
  ParticleClusters clusters_;
  RingSampler ring_;
  Resampler resampler_;

  Eigen::Vector2d last_fix_position_{Eigen::Vector2d::Zero()};  ///< estimated position at the last fix, for eq. (12)
  double turn_since_fix_{0.0};                                  ///< rad, for eq. (12)
  double last_accepted_time_s_{0.0};
  bool had_fix_{false};
};

}  // namespace urban_gnss
