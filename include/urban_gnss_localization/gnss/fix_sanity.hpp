#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "urban_gnss_localization/gnss/fix.hpp"
#include "urban_gnss_localization/gnss/fix_validation.hpp"

namespace urban_gnss {

/// What drivers are known to do wrong with the covariance of a sensor_msgs/NavSatFix. The order is that of importance.
enum class CovarianceMistake {
  /// sigma in place of sigma^2: gpsd_client copies gpsd's epx, epy, epv (gps_umd, client.cpp; three decimals, as gpsd's
  /// JSON has them).
  kSigmaForVariance,
  /// HDOP^2 as the variance, 4 HDOP^2 or VDOP^2 upwards: nmea_navsat_driver#17 (until its pull request 46), mavros
  /// without MAVLink 2 (mavros#1034, gps_uere 1.0).
  kHdopSquared,
  /// (0.1 m x HDOP)^2 for a fix with SBAS or differential corrections: nmea_navsat_driver's epe_quality2
  /// (nmea_navsat_driver#183 has a fix that is tens of metres off with it).
  kSbasDecimetre,
  /// In square degrees: below a tenth of a millimetre.
  kSquareDegrees,
  /// All zero, though the type says that it is known (novatel_oem7_driver#22).
  kZeros,
  /// NaN, infinite or negative, though the type says that it is known (gps_umd#82: gpsd_client with
  /// check_fix_by_variance off).
  kNoVariance,
  /// Beyond a kilometre: the largest number, millimetres, or "unknown" as a large number.
  kHuge,
  /// Variances beside the type UNKNOWN, so that the receiver's accuracy is ignored.
  kTypeForgotten,
  /// The same, bit for bit: a constant of the driver, not what the receiver says.
  kConstant,
};
inline constexpr std::size_t kCovarianceMistakes = static_cast<std::size_t>(CovarianceMistake::kConstant) + 1;

/// As a decision's reason names it, e.g. "HDOP^2 as variance".
const char* to_string(CovarianceMistake mistake);

/// A fix with a covariance that can be believed.
struct SaneFix {
  RawFix fix;
  std::string reason;  ///< why the covariance is not the driver's; empty where it is
};

/// Recognises known mistakes of drivers in a stream of fixes, each by its pattern in several fixes in a row, and says
/// each once. Replaces the covariance only where the pattern leaves no doubt and says what was meant:
///
/// | mistake | variance that is used |
/// |---|---|
/// | kSigmaForVariance | the square of what is declared |
/// | kHdopSquared, kSbasDecimetre | (fix_sigma_default x HDOP)^2 |
/// | kSquareDegrees | fix_sigma_default^2 |
///
/// Where `fix_covariance_scale` is not 1, somebody has already corrected the covariance: it stays as it is. What
/// validate_fix() replaces anyway is only said. Positions stay as they are: where they are no place, validate_fix()
/// rejects them and says what they may be (position_hint.hpp).
///
/// How large a receiver's errors really are is no matter of single fixes: filters learn it (FixNoiseModel).
class FixSanity {
 public:
  /// Requires parameters without faults.
  explicit FixSanity(const FixValidationParameters& parameters) : parameters_(parameters) {}

  /// The next fix. One without a position says nothing.
  SaneFix add(const RawFix& raw);

  struct News {
    bool is_warning{true};  ///< else for information
    std::string text;
  };
  /// What was found since the last call.
  std::vector<News> take_news();

  /// What explains that the fix was rejected for its distance from the datum (hint_of_far_place()); empty where nothing
  /// does, or where it was not. Said where it is no accident.
  void note_far(const std::string& hint) { note(far_, hint); }

  /// What is wrong with the covariance of the last fixes, e.g. for a status; empty where nothing is.
  std::string complaint() const;

 private:
  /// What of a mistake was seen.
  struct Evidence {
    std::size_t fixes{0};        ///< in a row
    std::set<double> variances;  ///< different ones among them, as many as are needed
    bool was_said{false};
  };
  /// Fixes in a wrong place that a known mistake explains.
  struct Misplaced {
    std::size_t fixes{0};  ///< in a row
    bool was_said{false};
  };
  void note(Misplaced& misplaced, const std::string& hint);
  bool is_shown(CovarianceMistake mistake) const;
  void observe(const RawFix& raw);
  std::optional<CovarianceMistake> current() const;

  FixValidationParameters parameters_;
  std::array<Evidence, kCovarianceMistakes> evidence_;
  Misplaced no_place_;
  Misplaced far_;
  std::optional<RawFix> last_;
  std::vector<News> news_;
};

}  // namespace urban_gnss
