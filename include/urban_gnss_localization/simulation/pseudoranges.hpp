#pragma once

#include <vector>

#include "urban_gnss_localization/common/parameters.hpp"
#include "urban_gnss_localization/common/random.hpp"
#include "urban_gnss_localization/gnss/satellite.hpp"
#include "urban_gnss_localization/simulation/correlator.hpp"
#include "urban_gnss_localization/simulation/signal_paths.hpp"

namespace urban_gnss {

/// What of a satellite's signal the receiver tracks.
enum class PathClass {
  kDirect,     ///< the line of sight, alone
  kMultipath,  ///< the line of sight, with reflections within reach of the correlator
  kNlos,       ///< a reflection, or the way over a roof's edge, without or instead of the line of sight
  kBlocked,    ///< nothing
};
EnumNames<PathClass> enum_names(PathClass);

/// How a receiver follows one satellite and what its pseudorange is worth.
struct ChannelParameters {
  double cn0_horizon{38.0};
  double cn0_zenith{47.0};
  double cn0_offset_sigma{1.5};
  double cn0_noise_sigma{1.0};
  double cn0_noise_time{10.0};
  double tracking_threshold{17.0};
  double acquisition_threshold{20.0};
  double acquisition_time{1.0};
  double correlator_spacing{0.5};
  double code_bandwidth{0.5};
  double integration_time{0.02};
  double atmosphere_sigma{0.6};
  double atmosphere_time{600.0};

  void visit(ParameterVisitor& v) {
    v("cn0_horizon", cn0_horizon, between(0.0, 70.0), "dB-Hz",
      "free signal at elevation 0: satellite, antenna, front end");
    v("cn0_zenith", cn0_zenith, between(0.0, 70.0), "", "dB-Hz");
    v("cn0_offset_sigma", cn0_offset_sigma, non_negative(), "dB", "between satellites");
    v("cn0_noise_sigma", cn0_noise_sigma, non_negative(), "dB", "slow changes of one satellite");
    v("cn0_noise_time", cn0_noise_time, positive(), "s", "their correlation time");
    v("tracking_threshold", tracking_threshold, between(0.0, 70.0), "dB-Hz", "a tracked signal is lost below");
    v("acquisition_threshold", acquisition_threshold, between(0.0, 70.0), "dB-Hz", "a signal is found above");
    v("acquisition_time", acquisition_time, non_negative(), "s", "that a signal must be there before it is tracked");
    v("correlator_spacing", correlator_spacing, open_between(0.0, 1.0), "", "chips");
    v("code_bandwidth", code_bandwidth, positive(), "Hz", "noise bandwidth of the code loop, aided by the carrier");
    v("integration_time", integration_time, positive(), "", "s");
    v("atmosphere_sigma", atmosphere_sigma, non_negative(), "",
      "m at the zenith: residual ionosphere, troposphere, orbit and clock");
    v("atmosphere_time", atmosphere_time, positive(), "s", "its correlation time");
  }
  void check(std::vector<std::string>& faults) const;
};

/// One satellite's signals as they arrive.
struct ReceivedSatellite {
  SatelliteId id;
  LookAngles look;
  Eigen::Vector3d line_of_sight{0.0, 0.0, 1.0};  ///< unit, to the satellite, east, north, up
  SignalPaths paths;
};

/// What a channel gives. The errors are truth that a receiver does not know.
struct ChannelOutput {
  PathClass path_class{PathClass::kBlocked};
  bool is_tracked{false};
  double cn0_dbhz{0.0};  ///< of the tracked signal; 0 where none is
  double excess_m{0.0};  ///< of the tracked path, over the line of sight
  double range_error_m{
      0.0};  ///< excess, correlator's error, thermal noise and atmosphere; without the receiver's clock
};

/// Free C/N0 by elevation, dB-Hz: from cn0_horizon to cn0_zenith with the sine of the elevation.
double free_cn0_dbhz(double elevation_rad, const ChannelParameters& parameters);

/// Growth of the atmosphere's residual towards the horizon (1 at the zenith): 1.001 / sqrt(0.002001 + sin^2), the
/// mapping function of RTCA DO-229 (tropospheric model); it stands for orbit and ionosphere, too.
double atmosphere_mapping(double elevation_rad);

/// Follows one satellite: the strongest path is tracked once it has been above acquisition_threshold for
/// acquisition_time, and until it falls below tracking_threshold. The other paths interfere in the correlator, each
/// with the carrier phase of its excess path and half a turn for each reflection. Interference and noise pass the code
/// loop as a first-order low-pass of code_bandwidth (time constant 1 / (4 B)), since the carrier aids the loop; a
/// change of the tracked path is followed at once.
class SatelliteChannel {
 public:
  SatelliteChannel(const ChannelParameters& parameters, RandomEngine& engine);

  /// `interval_s` > 0 since the last step. Uses the same number of draws whatever the paths, so that two worlds or two
  /// receivers meet the same noise.
  ChannelOutput step(double interval_s, const ReceivedSatellite& satellite, const ChannelParameters& parameters,
                     RandomEngine& engine);

 private:
  double cn0_offset_db_;
  double cn0_noise_;  ///< in units of its sigma, as below
  double atmosphere_;
  double code_noise_{0.0};
  double multipath_m_{0.0};
  double heard_for_s_{0.0};
  bool is_tracked_{false};
  std::vector<Interference> interferences_;
};

}  // namespace urban_gnss
