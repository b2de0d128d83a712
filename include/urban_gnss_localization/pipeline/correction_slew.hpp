#pragma once

#include <optional>

#include "urban_gnss_localization/common/parameters.hpp"
#include "urban_gnss_localization/pipeline/localization_pipeline.hpp"

namespace urban_gnss {

/// How fast map -> odom follows corrections of the estimate.
struct CorrectionSlewParameters {
  double max_correction_speed{0.0};

  void visit(ParameterVisitor& v) {
    v("max_correction_speed", max_correction_speed, non_negative(), "m/s",
      "speed at which map -> odom follows a correction of the estimate, with 1 m for 1 rad; a new start is followed at "
      "once; 0: all are");
  }
};

/// Lets map -> odom follow the estimate at a bounded speed, so that a controller that steers by tf sees no jump. The
/// published odometry is not touched: it stays the estimate, with the covariance that is the estimate's. By how much tf
/// lags behind it is behind_m().
class CorrectionSlew {
 public:
  /// Requires parameters without faults.
  explicit CorrectionSlew(const CorrectionSlewParameters& parameters) : parameters_(parameters) {}

  /// map -> odom at the next output. Follows at once where slewing is switched off, where the localizer started anew,
  /// where the stamps went back, and where the odometry's pose jumped.
  Pose2 follow(const LocalizationOutput& output);
  /// m, between the robot as tf has it and as it is estimated, with 1 m for 1 rad.
  double behind_m() const { return behind_m_; }

 private:
  /// The robot as tf would have it without a further correction; nothing where tf shall be the estimate.
  std::optional<Pose2> without_correction(const LocalizationOutput& output) const;

  CorrectionSlewParameters parameters_;
  std::optional<LocalizationOutput> last_;
  Pose2 map_to_odometry_;
  double behind_m_{0.0};
};

}  // namespace urban_gnss
