#pragma once

#include <Eigen/Core>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "urban_gnss_localization/common/parameters.hpp"
#include "urban_gnss_localization/gnss/fix.hpp"
#include "urban_gnss_localization/receivers/fix_noise_from_dop.hpp"
#include "urban_gnss_localization/receivers/nmea_fields.hpp"
#include "urban_gnss_localization/receivers/nmea_sentence.hpp"

namespace urban_gnss {

struct NmeaParameters {
  DopNoiseParameters noise;
  bool accept_simulated{false};

  void visit(ParameterVisitor& v) {
    v.include(noise);
    v("accept_simulated", accept_simulated,
      "take fixes that the receiver says are simulated (quality 8, mode S), as from a test bench");
  }
};

/// What sentences GGA, GNS, RMC, GLL, GSA, GST and VTG say about one solution.
///
/// - There is a fix where none of GGA, GNS, RMC and GLL denies it and one affirms it. Positions that the receiver
///   reckons without satellites (quality 6, mode E) or was told (7, M) are no fixes, nor are simulated ones (8, S)
///   unless they are accepted. GSA tells 2-D from 3-D only: in 2-D the receiver holds the altitude, so it is unknown.
/// - The position is that of GGA, else GNS, GLL, RMC. Altitude is above the ellipsoid: antenna's above sea level plus
///   the geoid's, which is taken to be 0 where it is missing; RMC and GLL have none (NaN).
/// - The covariance is that of GST: its ellipse where it agrees with the sigmas of latitude and longitude, else these.
///   Without a GST it is made of HDOP and VDOP; without these it is not declared.
/// - The velocity is speed and course over ground of RMC, else of VTG. Slower than 0.5 m/s without a course the robot
///   stands: the velocity is zero, with the speed as its sigma. No sentence tells a velocity's accuracy: otherwise the
///   covariance is not declared.
class NmeaSolution {
 public:
  /// Takes a sentence of these types; leaves others alone.
  void add(const NmeaSentence& sentence);

  /// Whether any sentence was about a position, if only to say that there is none.
  bool has_status() const { return has_status_; }
  bool has_fix(const NmeaParameters& parameters) const;

  /// `stamp` is given to both.
  RawFix fix(Stamp stamp, const NmeaParameters& parameters) const;
  /// Nothing where there is no fix, or no velocity with it.
  std::optional<RawVelocity> velocity(Stamp stamp, const NmeaParameters& parameters) const;

  bool lacks_geoid() const { return lacks_geoid_; }
  /// The receiver says that the position is reckoned, told, or simulated.
  bool is_reckoned() const { return quality_ == 6 || mode_ == 'E'; }
  bool is_told() const { return quality_ == 7 || mode_ == 'M'; }
  bool is_simulated() const { return quality_ == 8 || mode_ == 'S'; }

 private:
  static constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

  void add_gga(const NmeaSentence& sentence);
  void add_gns(const NmeaSentence& sentence);
  void add_rmc(const NmeaSentence& sentence);
  void add_gll(const NmeaSentence& sentence);
  void add_gsa(const NmeaSentence& sentence);
  void add_gst(const NmeaSentence& sentence);
  void add_vtg(const NmeaSentence& sentence);
  /// Sets the position where it is better than what is known: a lower rank.
  void set_position(int rank, const NmeaSentence& sentence, std::size_t at, double altitude_m);
  void say(bool has_fix) { (has_fix ? affirmed_ : denied_) = true; }
  double altitude(const NmeaSentence& sentence, std::size_t above_sea, std::size_t geoid);
  SolutionKind kind() const;

  bool has_status_{false};
  bool affirmed_{false};
  bool denied_{false};
  int quality_{0};    ///< of GGA; 0 where there is none
  char mode_{0};      ///< of RMC, GLL or GNS, the best; 0 where there is none
  int dimension_{0};  ///< of GSA, the greatest; 0 where there is none

  int position_rank_{std::numeric_limits<int>::max()};
  GeodeticPosition position_{kUnknown, kUnknown, kUnknown};
  bool lacks_geoid_{false};
  double hdop_{kUnknown};
  double vdop_{kUnknown};
  std::optional<Eigen::Matrix3d> declared_;            ///< m^2, ENU
  double rmc_speed_{kUnknown}, rmc_course_{kUnknown};  ///< m/s; rad, clockwise from north
  double vtg_speed_{kUnknown}, vtg_course_{kUnknown};
};

/// Whether it is one of those that tell a position, if only that there is none: GGA, GNS, RMC, GLL.
bool is_about_position(const NmeaSentence& sentence);
/// The time of day that a sentence has; nothing for types without one, or where the field is empty.
std::optional<Stamp> time_of_day(const NmeaSentence& sentence);
/// The date that a sentence RMC or ZDA has.
std::optional<Day> day_of(const NmeaSentence& sentence);

}  // namespace urban_gnss
