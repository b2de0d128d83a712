#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

#include "urban_gnss_localization/localizers/particle_localizer.hpp"
#include "urban_gnss_localization/localizers/switching/bias_ekf.hpp"
#include "urban_gnss_localization/localizers/switching/fix_statistics.hpp"
#include "urban_gnss_localization/localizers/switching/mixture_reduction.hpp"

namespace urban_gnss {

struct SwitchingParticleFilterParameters {
  int max_particles{100};
  double merge_distance{0.5};
  EstimateMethod estimate{EstimateMethod::kHeaviestCluster};
  double cluster_cell{1.0};
  int seed{1};
  SwitchingModelParameters model;

  void visit(ParameterVisitor& v) {
    v("max_particles", max_particles, between(1, 10000), "",
      "greatest number of particles, each an extended Kalman filter; only plausible ones are kept");
    v("merge_distance", merge_distance, non_negative(), "",
      "Bhattacharyya distance below which particles of the same mode are merged; large: imm_ekf");
    v("estimate", estimate, "output pose: mean of all particles, or of the heaviest cluster");
    v("cluster_cell", cluster_cell, positive(), "m",
      "standard deviation added to those of two particles, which share a cluster within three of the combined ones");
    v("seed", seed, any_number(), "", "seed of the random numbers; the same bag and seed give the same estimates");
    v.include(model);
  }
};

/// The Rao-Blackwellized particle filter of a switching bias. A particle is a history of modes (BiasMode), and the
/// heading that it began with where that was not known; given these, pose, odometry errors and bias are Gaussian, and
/// each particle has the extended Kalman filter that imm_ekf has for each mode (localizers/switching/bias_ekf.hpp).
///
/// At a fix every particle goes on in every mode, with the transition probabilities of the time since the last fix.
/// Those that then are nearly the same are merged; each takes the fix, which weighs it; of the light ones a few survive
/// (MixtureReducer). imm_ekf is the same with all of a mode merged: with a large merge_distance this is imm_ekf. So the
/// number of particles adapts itself: few where the modes are clear, many at a start with an unknown heading and where
/// fixes contradict each other.
///
/// The estimate is that of the heaviest cluster: of particles whose positions are within three standard deviations of
/// the heaviest of them. Its covariance is that of all particles about it.
///
/// Input that is not finite changes nothing.
class SwitchingParticleFilter : public ParticleLocalizer {
 public:
  /// Requires parameters without faults.
  SwitchingParticleFilter(const SwitchingParticleFilterParameters& parameters, const MotionParameters& motion);

  const char* name() const override { return "switching_particle_filter"; }
  std::string mode() const override { return "switching"; }
  bool wants_bias() const override { return false; }
  bool takes_velocity() const override { return true; }
  bool takes_satellites() const override { return parameters_.model.ranges.use_ranges; }
  /// A heading with a variance of pi^2/3 or more is unknown: particles are spread over the circle. Throws
  /// std::invalid_argument where pose or covariance is not finite.
  void initialize(const PoseEstimate& start) override;
  /// Leaves out a step that is not finite or not positive in duration.
  void move(const Twist2& twist, double duration_s) override;
  void doubt(const MotionDoubt& doubt) override;
  /// kRejectedNonFinite for a fix that is not finite or has no positive definite covariance.
  FixOutcome correct(const FixMeasurement& fix) override;
  /// Leaves out a velocity that cannot be used.
  void correct_velocity(const VelocityMeasurement& velocity) override;
  PoseEstimate estimate() const override;
  LocalizerHealth health() const override;

  const std::vector<BiasHypothesis>& hypotheses() const { return hypotheses_; }
  /// All of them together.
  BiasGaussian mixture() const;
  /// Weight of the particles in each mode.
  ModeProbabilities mode_probabilities() const;

 private:
  /// What all that may have happened says of a fix together.
  struct Opinion {
    double outlier{0.0};    ///< probability that it is one
    double exceeding{0.0};  ///< share of the NIS beyond the median
  };
  /// Fills next_ with all that may have happened up to the fix; false where nothing of it is finite.
  bool continue_all(const FixMeasurement& fix, Opinion& opinion);
  /// Of the particles as they stand, with their weights; and update_estimate().
  void find_clusters();
  /// Pose and cloud of the particles as they stand.
  void update_estimate();
  void draw_cloud();
  /// One hypothesis more than are kept, by rounding; at a start one for each quality of the odometry.
  std::size_t capacity() const { return std::max<std::size_t>(most_, kQualityLevels) + 1; }

  SwitchingParticleFilterParameters parameters_;
  MotionParameters motion_;
  double nis_threshold_;
  std::size_t most_;
  RandomEngine engine_;
  FixStatistics statistics_;
  std::array<OdometryErrorParameters, kQualityLevels> levels_;
  MixtureReducer reducer_;
  std::vector<BiasHypothesis> hypotheses_;
  std::vector<BiasHypothesis> next_;
  std::vector<BiasEkfUpdate> updates_;  ///< of next_
  std::vector<std::uint32_t> cluster_;  ///< of each particle
  std::vector<double> cluster_mass_;    ///< of each cluster
  std::uint32_t heaviest_{0};           ///< cluster
  std::vector<Eigen::Vector3d> draws_;  ///< of each particle's pose in the cloud, standard normal
};

}  // namespace urban_gnss
