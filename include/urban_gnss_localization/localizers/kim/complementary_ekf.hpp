#pragma once

#include <optional>
#include <vector>

#include "urban_gnss_localization/gnss/heading_initializer.hpp"
#include "urban_gnss_localization/localizers/bias_estimate.hpp"
#include "urban_gnss_localization/localizers/kim/bias_detector.hpp"
#include "urban_gnss_localization/localizers/kim/complementary_ekf_parameters.hpp"
#include "urban_gnss_localization/localizers/kim/fix_noise_monitor.hpp"
#include "urban_gnss_localization/localizers/kim/two_stage_filter.hpp"
#include "urban_gnss_localization/localizers/localizer.hpp"
#include "urban_gnss_localization/motion/dead_reckoning.hpp"
#include "urban_gnss_localization/motion/standstill.hpp"

namespace urban_gnss {

/// The complementary filter of Kim et al. with compensation of the fix's bias (Fig. 4).
///
/// The odometry is dead-reckoned (eq. 1-3). At a fix, the difference "fix - dead reckoning" drives a Kalman filter of
/// the dead reckoning's error, whose estimate is fed back. In `compensated` mode, as we read it:
///   1. test the innovation (BiasDetector);
///   2. where it is taken for biased, open the bias filter: b = 0, covariance M0 (TwoStageFilter);
///   3. while open, let the bias walk, correct both stages, feed back the compensated error;
///   4. where the very next fix speaks for no bias, it was a false alarm: go on as if it had not been;
///   5. close it when the bias has been insignificant for some fixes, or a fix agrees with no bias again at once.
/// The error states are the pose and, where estimate_odometry_errors, what the odometry is wrong by.
///
/// In `compensated_as_printed` mode the error states are the pose alone, the bias is constant, and figure 4 remains:
/// the bias filter opens where the NIS of "fix - fed-back pose" is above 7.81, and closes where it is not.
/// `standard_as_printed` and `gated_as_printed` are the same without a bias filter.
///
/// A heading that is wrong by radians is beyond a linearisation: started without a heading, the position follows the
/// fixes, and the filter starts once HeadingInitializer has found one.
class ComplementaryEkf : public Localizer {
 public:
  /// Requires parameters without faults.
  explicit ComplementaryEkf(const ComplementaryEkfParameters& parameters);

  const char* name() const override { return "complementary_ekf"; }
  std::string mode() const override { return enum_name(parameters_.mode); }
  bool is_as_printed() const override { return urban_gnss::is_as_printed(parameters_.mode); }
  bool wants_bias() const override { return false; }
  bool gates() const override { return !is_as_printed() && parameters_.mode != ComplementaryMode::kStandard; }
  bool estimates_bias() const override { return true; }
  void initialize(const PoseEstimate& start) override;
  void move(const Twist2& twist, double duration_s) override;
  void doubt(const MotionDoubt& doubt) override;
  FixOutcome correct(const FixMeasurement& fix) override;
  Pose2 pose() const override { return pose_; }
  PoseEstimate estimate() const override;
  LocalizerHealth health() const override;

  /// Takes effect at once; closes the bias filter. As printed the odometry is taken for right from then on; back to a
  /// mode of ours its errors are as unknown as at a start.
  void set_mode(ComplementaryMode mode);

  /// The odometry alone since the start, which never jumps, and the correction: correction o dead_reckoned = pose.
  const Pose2& dead_reckoned() const { return dead_reckoned_; }
  Pose2 correction() const { return compose(pose_, inverse(dead_reckoned_)); }
  const OdometryErrors& odometry_errors() const { return errors_; }
  /// Of the error states, with the bias's share.
  ErrorCovariance error_covariance() const { return filter_.compensated_covariance(); }

  bool is_bias_open() const { return is_open_; }
  Eigen::Vector2d bias() const { return filter_.bias(); }
  Eigen::Matrix2d bias_covariance() const { return filter_.bias_covariance(); }
  /// smallest_detectable_jump (m) at the last fix; 0 before the first.
  double smallest_detectable_jump_m() const;

  std::vector<BiasEstimate> take_bias_estimates() override;

 private:
  using Filter = TwoStageFilter<kErrorStates, 2, 2>;

  /// One fix, linearised about the pose.
  struct Innovation {
    Eigen::Vector2d value;  ///< m, fix minus predicted antenna, without the bias
    Filter::Observation observation;
    Eigen::Matrix2d declared;  ///< m^2
    Eigen::Matrix2d noise;     ///< m^2, as estimation believes it
    double time_s;
  };
  /// Since when fixes have been doubted without a break.
  struct Run {
    double since_s;
    double last_s;
    Eigen::Matrix2d covariance;  ///< m^2, of the predicted antenna when it began, grown for detection_horizon
    bool is_frozen;
  };

  /// What the mode takes the odometry's errors for.
  OdometryErrorParameters odometry_of_mode() const;
  /// Factor on the declared covariance, as the fixes scatter and as the robot stands.
  double noise_inflation() const;
  /// Without a heading: takes the fix for the position and for the search. True where the heading was found.
  bool search_heading(const FixMeasurement& fix, const Innovation& innovation);
  void decide(const Innovation& innovation, FixOutcome& outcome);
  void decide_as_printed(const Innovation& innovation, FixOutcome& outcome);
  void decide_open(const Innovation& innovation, FixOutcome& outcome);
  void open_or_reject(const Innovation& innovation, FixOutcome& outcome);
  void open();
  Eigen::Matrix2d initial_bias_covariance() const;  ///< M0
  void reject(const Innovation& innovation, FixOutcome& outcome);
  /// Whether the first fix after the opening speaks for no bias; ends the bias filter where it does.
  bool is_false_alarm(const Innovation& innovation, double direct_nis, FixOutcome& outcome);
  void close();
  void feed_back();
  void close_if_insignificant(const Innovation& innovation, FixOutcome& outcome);
  void apply(const Innovation& innovation);
  void restart_position(const Innovation& innovation);
  /// Covariance of the predicted antenna by short-horizon odometry: what the tests use.
  Eigen::Matrix2d prediction_covariance(const Innovation& innovation) const;
  void doubt(const Innovation& innovation);
  double bias_statistic() const;
  void publish(const FixMeasurement& fix, const Eigen::Vector2d& predicted, const FixOutcome& outcome);

  ComplementaryEkfParameters parameters_;
  OdometryErrorParameters odometry_;
  BiasDetector detector_;
  FixNoiseMonitor noise_monitor_;
  double close_threshold_;
  double spike_threshold_;  ///< NIS that is no false alarm

  Pose2 pose_;
  Pose2 dead_reckoned_;
  OdometryErrors errors_;
  /// Of the errors of pose_ and errors_. After each feedback the compensated error is 0.
  Filter filter_{ErrorState::Zero(), ErrorCovariance::Zero()};
  Eigen::Vector2d path_{Eigen::Vector2d::Zero()};  ///< m, moved since the start, without corrections
  double path_variance_m2_{0.0};

  bool is_open_{false};
  double opened_s_{0.0};
  double opening_nis_{0.0};
  bool is_confirmed_{false};  ///< a fix after the opening agreed with the bias
  double last_fix_s_{0.0};
  bool had_fix_{false};
  Reacquisition reacquisition_;
  double common_variance_m2_{0.0};  ///< per axis, of the error that all fixes share
  int insignificant_{0};
  std::optional<Run> run_;
  std::optional<HeadingInitializer> heading_search_;  ///< while the heading is unknown
  Travel since_fix_;                                  ///< of odometry
  Eigen::Matrix2d last_test_covariance_{Eigen::Matrix2d::Zero()};
  std::vector<BiasEstimate> bias_estimates_;
};

}  // namespace urban_gnss
