#pragma once

#include <deque>
#include <optional>
#include <string>

#include "urban_gnss_localization/common/parameters.hpp"
#include "urban_gnss_localization/common/stamp.hpp"

namespace urban_gnss {

/// How far an IMU's orientation is believed to tell the heading.
enum class ImuHeadingUse {
  kNone,
  kLearnt,    ///< once its constant offset has been found from other headings
  kAbsolute,  ///< as it says, in the axes of REP-103: 0 is east
};
EnumNames<ImuHeadingUse> enum_names(ImuHeadingUse);

struct ImuHeadingParameters {
  ImuHeadingUse imu_heading{ImuHeadingUse::kLearnt};
  double imu_heading_offset{0.0};
  double imu_heading_sigma{0.2};

  bool is_used() const { return imu_heading != ImuHeadingUse::kNone; }

  void visit(ParameterVisitor& v) {
    v("imu_heading", imu_heading,
      "use of the heading in imu/data's orientation; none: not used; learnt: once its offset is known from other "
      "headings; absolute: as it says, 0 is east");
    v("imu_heading_offset", imu_heading_offset, any_number(), "rad",
      "added to the IMU's heading, counter-clockwise; for magnetic north: minus the declination (east positive)");
    v("imu_heading_sigma", imu_heading_sigma, positive(), "rad",
      "least standard deviation of the IMU's heading, whatever the message declares");
  }
};

/// A heading of the base, counter-clockwise from east.
struct HeadingSample {
  Stamp stamp{0};
  double yaw_rad{0.0};
  double sigma_rad{0.0};  ///< as declared; 0: not declared
};

/// What the comparison with other headings says of an IMU's.
enum class ImuHeadingVerdict {
  kUnknown,
  kFits,
  kTurned,   ///< it is off by a constant
  kWanders,  ///< it is off by now this and now that
};

/// Compares an IMU's heading with headings that do not depend on it, of the last minutes, and says how good it is.
///
/// A magnetometer is off by the declination and by the robot's own iron for ever, and by the steel of a building while
/// it is near. The mean difference is the constant part; the scatter about it, or for kAbsolute the root mean square of
/// the differences, is added to the standard deviation. So a heading that lies has none of the say that it claims.
class HeadingCalibration {
 public:
  /// Requires parameters without faults.
  explicit HeadingCalibration(const ImuHeadingParameters& parameters) : parameters_(parameters) {}

  /// Whether a comparison at this stamp would be independent enough of the last.
  bool is_due(Stamp stamp) const;
  /// The IMU's heading minus another one of the same stamp, and the other one's standard deviation (rad, finite). Says
  /// whether the verdict is another one than before.
  bool add(Stamp stamp, double difference_rad, double other_sigma_rad);

  /// What the IMU's heading is worth: with its offset taken off and an honest standard deviation. Nothing with kNone,
  /// and with kLearnt as long as there are too few comparisons.
  std::optional<HeadingSample> calibrated(const HeadingSample& told) const;

  ImuHeadingVerdict verdict() const { return verdict_; }
  /// The verdict as a sentence for people; empty while it is unknown.
  std::string describe() const;
  void reset() { *this = HeadingCalibration(parameters_); }

 private:
  struct Comparison {
    Stamp stamp;
    double difference_rad;
    double other_sigma_rad;
  };
  /// Of the comparisons.
  struct Scatter {
    double mean_rad{0.0};
    double spread_rad{0.0};  ///< about the mean
    double other_variance_rad2{0.0};
  };
  bool is_known() const;
  Scatter scatter() const;

  ImuHeadingParameters parameters_;
  std::deque<Comparison> comparisons_;
  ImuHeadingVerdict verdict_{ImuHeadingVerdict::kUnknown};
};

}  // namespace urban_gnss
