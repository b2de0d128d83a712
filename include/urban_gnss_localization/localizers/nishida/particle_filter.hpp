#pragma once

#include <cstdint>

#include "urban_gnss_localization/gnss/fix_sigma.hpp"
#include "urban_gnss_localization/localizers/nishida/estimation.hpp"
#include "urban_gnss_localization/localizers/nishida/fix_likelihood.hpp"
#include "urban_gnss_localization/localizers/nishida/particle_filter_mode.hpp"
#include "urban_gnss_localization/localizers/nishida/resampling.hpp"
#include "urban_gnss_localization/localizers/nishida/sampling.hpp"
#include "urban_gnss_localization/localizers/particle_localizer.hpp"

namespace urban_gnss {

/// A choice that the mode makes unless it is made explicitly.
enum class LikelihoodChoice { kAuto, kPrinted, kSum, kProduct };
enum class Switch { kAuto, kAlways, kNever };  // YAML 1.1 reads "on" and "off" as booleans
enum class EstimateChoice { kAuto, kMean, kHeaviestCluster };
EnumNames<LikelihoodChoice> enum_names(LikelihoodChoice);
EnumNames<Switch> enum_names(Switch);
EnumNames<EstimateChoice> enum_names(EstimateChoice);

struct ParticleFilterParameters {
  ParticleFilterMode mode{ParticleFilterMode::kPaper};
  int particle_count{1000};
  double ring_share{0.05};
  LikelihoodChoice likelihood{LikelihoodChoice::kAuto};
  Switch use_gps_heading{Switch::kAuto};
  double gps_heading_sigma{0.1};
  double ess_threshold{5.0};
  ResamplingScheme resampling{ResamplingScheme::kMultinomial};
  EstimateChoice estimate{EstimateChoice::kAuto};
  double cluster_cell{1.0};
  double gate_probability{0.99};
  double gate_timeout{5.0};
  int seed{1};
  FixSigmaParameters fix;

  void visit(ParameterVisitor& v) {
    v.basic()("mode", mode,
              "filter variant; literal: as printed; paper: the reading that works; conventional: eq. (46), (47) as "
              "printed; as printed, each fix has direct_sigma, and none is gated");
    v.include(fix);
    v("particle_count", particle_count, between(1, 1000000), "", "number of particles, M");
    v("ring_share", ring_share, between(0.0, 1.0), "",
      "share of the particles drawn on the ring of radius r-hat, eq. (22)");
    v("likelihood", likelihood,
      "form of the likelihood, eq. (27), (31): printed, sum or product; auto: product in mode paper, else printed");
    v("use_gps_heading", use_gps_heading,
      "use of theta_GPS, eq. (12): always or never; auto: not with the product likelihood");
    v("gps_heading_sigma", gps_heading_sigma, positive(), "rad",
      "standard deviation sigma_p of theta_GPS, eq. (27), (31)");
    v("ess_threshold", ess_threshold, non_negative(), "",
      "effective sample size, eq. (39), below which the particles are resampled");
    v("resampling", resampling, "resampling scheme, eq. (40): multinomial, or systematic (less variance)");
    v("estimate", estimate,
      "output pose, eq. (35): mean of all particles, or of the heaviest cluster; auto: heaviest_cluster in mode paper, "
      "else mean");
    v("cluster_cell", cluster_cell, positive(), "m",
      "cell size of the clustering; particles within one to two cells belong together");
    v("gate_probability", gate_probability, open_between(0.0, 1.0), "",
      "probability that a good fix passes the gate (conventional with another likelihood than printed); 1: no gate");
    v("gate_timeout", gate_timeout, positive(), "s",
      "time with nothing but rejected fixes after which the filter restarts on the fix");
    v("seed", seed, any_number(), "", "seed of the random numbers; the same bag and seed give the same estimates");
  }
  void check(std::vector<std::string>& faults) const;

  /// What `auto` stands for in this mode.
  LikelihoodForm likelihood_form() const;
  bool uses_gps_heading() const;
  bool averages_all() const;
  /// The text to the letter: its likelihood with one sigma_b, no gate, angles averaged as numbers. `literal` and
  /// `conventional`, unless another likelihood is asked for.
  bool is_as_printed() const;
};

/// The particle filter of Nishida et al., Algorithm 1: sample, weigh, estimate, resample.
class ParticleFilter : public ParticleLocalizer {
 public:
  /// Requires parameters without faults.
  ParticleFilter(const ParticleFilterParameters& parameters, const MotionParameters& motion);

  const char* name() const override { return "particle_filter"; }
  std::string mode() const override { return enum_name(parameters_.mode); }
  bool is_as_printed() const override { return parameters_.is_as_printed(); }
  ParticleFilterMode filter_mode() const { return parameters_.mode; }
  bool wants_bias() const override { return parameters_.mode != ParticleFilterMode::kConventional; }
  bool gates() const override {
    return !wants_bias() && !parameters_.is_as_printed() && parameters_.gate_probability < 1.0;
  }
  void initialize(const PoseEstimate& start) override;
  void move(const Twist2& twist, double duration_s) override;
  void doubt(const MotionDoubt& doubt) override;
  FixOutcome correct(const FixMeasurement& fix) override;
  /// The covariance is that of all particles about the pose, other clusters included.
  PoseEstimate estimate() const override { return {estimate_, covariance_about(particles_, estimate_)}; }
  LocalizerHealth health() const override;

 private:
  RandomStream next_stream() { return RandomStream(engine_()); }
  FixLikelihood likelihood_of(const FixMeasurement& fix) const;
  Pose2 posterior_mean();
  void examine(const FixMeasurement& fix, FixOutcome& outcome) const;
  bool is_gated(const FixMeasurement& fix, FixOutcome& outcome);

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
