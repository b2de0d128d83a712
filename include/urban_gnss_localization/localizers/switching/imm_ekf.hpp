#pragma once

#include <Eigen/Core>
#include <array>

#include "urban_gnss_localization/localizers/switching/bias_quad.hpp"
#include "urban_gnss_localization/localizers/switching/fix_statistics.hpp"

namespace urban_gnss {

using ImmEkfParameters = SwitchingModelParameters;

/// The switching bias as an interacting multiple model (Blom and Bar-Shalom 1988): one extended Kalman filter for each
/// mode of a fix, mixed by matching moments at each fix.
///
/// Each filter's state is (x, y, yaw, s, w, a, b_x, b_y): pose, relative error of the odometry's speed, constant and
/// relative error of its yaw rate, bias of the fixes. In the direct mode the bias is 0. At a fix, the modes before it
/// are mixed into those that can go on from them (mode_transition(), bias_steps()); each takes the fix with its own
/// noise; its probability is multiplied by the fix's likelihood. A fix is an outlier with outlier_share: then it is
/// anywhere, and says nothing. Each mode weighs that in, and a jump is a slow bias once the fix is taken.
///
/// Input that is not finite changes nothing.
class ImmEkf : public Localizer {
 public:
  using Gaussian = BiasGaussian;

  /// Requires parameters without faults.
  ImmEkf(const ImmEkfParameters& parameters, const MotionParameters& motion);

  const char* name() const override { return "imm_ekf"; }
  std::string mode() const override { return "switching"; }
  bool wants_bias() const override { return false; }
  /// Throws std::invalid_argument where pose or covariance is not finite.
  void initialize(const PoseEstimate& start) override;
  /// Leaves out a step that is not finite or not positive in duration.
  void move(const Twist2& twist, double duration_s) override;
  void doubt(const MotionDoubt& doubt) override;
  /// kRejectedNonFinite for a fix that is not finite or has no positive definite covariance.
  FixOutcome correct(const FixMeasurement& fix) override;
  bool takes_velocity() const override { return true; }
  /// Leaves out a velocity that cannot be used.
  void correct_velocity(const VelocityMeasurement& velocity) override;
  bool takes_satellites() const override { return parameters_.ranges.use_ranges; }
  Pose2 pose() const override;
  PoseEstimate estimate() const override;
  LocalizerHealth health() const override;

  /// Of the bias, all qualities of the odometry together.
  ModeProbabilities mode_probabilities() const;
  QualityProbabilities quality_probabilities() const;
  /// The state given the mode at the last fix.
  Gaussian given(BiasMode mode) const;
  /// All modes together.
  Gaussian mixture() const;

 private:
  /// The filters of all modes that a fix may have at each quality, each with the fix taken.
  struct Branches {
    BiasQuads filters;
    BiasQuadUpdates updates;
    QualityNumbers probability{};           ///< posterior
    QualityProbabilities expected_quality;  ///< before the fix
    bool are_finite{false};
  };
  Branches branch(const FixMeasurement& fix) const;
  /// Weighs the filters of each quality so that they sum to `target`.
  void set_quality(const QualityProbabilities& target);
  /// Goes on with the filters of the branches, those of slow bias and of a jump as one.
  void merge(const Branches& branches);

  ImmEkfParameters parameters_;
  MotionParameters motion_;
  double nis_threshold_;
  FixStatistics statistics_;
  std::array<OdometryErrorParameters, kQualityLevels> levels_;
  BiasQuads filters_{};
  QualityNumbers probability_{};  ///< 0 of the idle filters
};

}  // namespace urban_gnss
