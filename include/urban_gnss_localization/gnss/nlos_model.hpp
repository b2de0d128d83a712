#pragma once

#include <string>
#include <vector>

#include "urban_gnss_localization/common/parameters.hpp"
#include "urban_gnss_localization/gnss/satellite.hpp"

namespace urban_gnss {

/// Elevation (rad) at which NLOS parameters are given: 37 degrees, where the sine is 0.6 and the cotangent 4/3.
inline constexpr double kNlosReferenceElevation_rad = 0.64350110879328438680;

/// How the excess range of an NLOS signal grows with a falling elevation e: a factor that is 1 at 37 degrees.
enum class NlosElevationLaw {
  kCotangent,  ///< (cot e / cot 37°)^n down to 15°: the way between walls of a signal that comes over their roofs
  kCosecant,   ///< (sin 37° / sin e)^n down to 6°: grows less steeply towards the zenith
};
EnumNames<NlosElevationLaw> enum_names(NlosElevationLaw);

/// Excess range of an NLOS signal, and what its C/N0 says of whether it is one.
struct NlosParameters {
  double mean{22.0};
  double sigma{40.0};
  NlosElevationLaw elevation_law{NlosElevationLaw::kCosecant};
  double elevation_exponent{0.7};
  double cn0_width{2.5};
  double cn0_rise{10.0};

  void visit(ParameterVisitor& v) {
    v("nlos_mean", mean, non_negative(), "m", "mean excess range of an NLOS signal at 37 degrees elevation");
    v("nlos_sigma", sigma, positive(), "m",
      "standard deviation of the excess range of an NLOS signal at 37 degrees elevation");
    v("nlos_elevation_law", elevation_law,
      "law by which mean and standard deviation of the excess range grow towards low elevations");
    v("nlos_elevation_exponent", elevation_exponent, between(0.0, 5.0), "",
      "exponent of nlos_elevation_law; 0: no growth");
    v("nlos_cn0_width", cn0_width, positive(), "dB",
      "change of C/N0 that changes the odds of an NLOS signal by a factor of e");
    v("nlos_cn0_rise", cn0_rise, between(-30.0, 30.0), "dB",
      "rise, from horizon to zenith, of the C/N0 at which a signal is as likely NLOS as in line of sight");
  }
};

/// Excess range of an NLOS signal.
struct NlosRange {
  double mean_m;
  double sigma_m;
};

/// At this elevation, `factor` times as large as the parameters say.
NlosRange nlos_range(double elevation_rad, const NlosParameters& parameters, double factor = 1.0);

/// dB, by which C/N0 is larger at this elevation than at 37 degrees.
double cn0_gain_db(double elevation_rad, const NlosParameters& parameters);

/// C/N0 (dB-Hz) that the signal would have at 37 degrees elevation.
double levelled_cn0_dbhz(const SatelliteObservation& satellite, const NlosParameters& parameters);

/// Log-odds of an NLOS signal against one in line of sight, whose C/N0 is so far below that of even odds (dB).
double nlos_log_odds(double below_even_db, const NlosParameters& parameters);

double log_odds(double probability);
/// The inverse, strictly between 0 and 1 for log-odds of any size.
double probability_of(double log_odds);

}  // namespace urban_gnss
