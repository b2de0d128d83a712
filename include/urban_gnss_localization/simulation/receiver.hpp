#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <optional>
#include <vector>

#include "urban_gnss_localization/common/parameters.hpp"
#include "urban_gnss_localization/common/random.hpp"
#include "urban_gnss_localization/geometry/angles.hpp"
#include "urban_gnss_localization/gnss/fix.hpp"
#include "urban_gnss_localization/gnss/satellite.hpp"
#include "urban_gnss_localization/simulation/position_solution.hpp"
#include "urban_gnss_localization/simulation/pseudoranges.hpp"

namespace urban_gnss {

/// A consumer receiver: how it follows satellites, solves, smooths, and what it claims.
struct ReceiverParameters {
  double rate{5.0};
  ChannelParameters channel;
  double clock_walk{0.5};
  double elevation_mask{0.0873};
  double sigma_cn0{40.0};
  double altitude_prior_sigma{30.0};
  double max_hdop{20.0};
  double smoothing_time{8.0};
  double coasting_time{3.0};
  double velocity_sigma{0.05};
  double velocity_nlos_sigma{0.5};
  double uere{3.0};
  double angle_resolution{kPi / 180.0};
  double latency_min{0.05};
  double latency_max{0.2};
  double fix_delay{0.0};
  bool declares_covariance{true};
  bool publishes_velocity{true};
  bool publishes_satellites{true};

  void visit(ParameterVisitor& v) {
    v("rate", rate, between(0.1, 50.0), "Hz", "of epochs; for the caller, who passes the interval");
    v.include(channel);
    v("clock_walk", clock_walk, non_negative(), "m/sqrt(s)", "of each constellation's clock");
    v("elevation_mask", elevation_mask, between(-kPi / 2.0, kPi / 2.0), "rad", "satellites below are not used");
    v("sigma_cn0", sigma_cn0, between(0.0, 70.0), "", "dB-Hz at which the receiver believes in uere for one range");
    v("altitude_prior_sigma", altitude_prior_sigma, non_negative(), "m",
      "about the receiver's own last height; 0 turns the belief off");
    v("max_hdop", max_hdop, positive(), "", "no fix beyond");
    v("smoothing_time", smoothing_time, non_negative(), "s", "of the filter over the solutions; 0 turns it off");
    v("coasting_time", coasting_time, non_negative(), "s", "without a solution after which that filter starts anew");
    v("velocity_sigma", velocity_sigma, non_negative(), "m/s per axis",
      "of a Doppler solution with HDOP 1 and free signals");
    v("velocity_nlos_sigma", velocity_nlos_sigma, non_negative(), "m/s per axis",
      "added by the share of satellites without line of sight");
    v("uere", uere, positive(), "m", "that the claimed covariance takes for every satellite");
    v("angle_resolution", angle_resolution, between(0.0, 0.2), "rad",
      "reported azimuth and elevation are rounded to it; 0 = not rounded");
    v("latency_min", latency_min, non_negative(), "s", "from the epoch to the publication");
    v("latency_max", latency_max, non_negative(), "", "s");
    v("fix_delay", fix_delay, between(0.0, 60.0), "s",
      "by which the stamp is later than what it stands on: position, velocity and satellites are those of so long "
      "before; for the caller, who passes them");
    v("declares_covariance", declares_covariance, "false: the fix says that its covariance is unknown");
    v("publishes_velocity", publishes_velocity, "false: the velocity from Doppler smooths the fix and nothing else");
    v("publishes_satellites", publishes_satellites, "for the caller, who publishes them");
  }
  void check(std::vector<std::string>& faults) const;
};

/// What the receiver says of one satellite, and the truth about it.
struct SatelliteReport {
  SatelliteId id;
  LookAngles look;       ///< rounded to angle_resolution
  double cn0_dbhz{0.0};  ///< rounded to 1 dB; NaN where not tracked
  bool is_tracked{false};
  bool is_used{false};
  /// Measured minus expected range at the fix's position (as in sentence GRS of NMEA 0183, with the opposite sign),
  /// with the clocks that fit best there; NaN where not used.
  double residual_m{0.0};

  PathClass path_class{PathClass::kBlocked};  ///< truth
  double range_error_m{0.0};  ///< truth, of the pseudorange, without the receiver's clock; NaN where not tracked
  double excess_m{0.0};       ///< truth, of the tracked path over the line of sight; NaN where not tracked
};

/// What a receiver reports of its satellites, without the truth about them.
std::vector<SatelliteObservation> to_observations(const std::vector<SatelliteReport>& reports);

/// A position with what the receiver claims of it.
struct ReceiverFix {
  Eigen::Vector3d position{Eigen::Vector3d::Zero()};  ///< m, of the antenna, map frame (east, north, up)
  /// m^2, east, north, up: diag((uere HDOP)^2, (uere HDOP)^2, (uere VDOP)^2) over all satellites used, as drivers of
  /// NMEA receivers make it.
  Eigen::Matrix3d covariance{Eigen::Matrix3d::Identity()};
  CovarianceType covariance_type{CovarianceType::kApproximated};  ///< kUnknown: the covariance is not published
  Eigen::Vector3d velocity{Eigen::Vector3d::Zero()};              ///< m/s, from Doppler
  double velocity_sigma_mps{0.0};                                 ///< claimed, per axis; 0: not published
};

struct ReceiverEpoch {
  std::optional<ReceiverFix> fix;  ///< nothing: the receiver has no fix
  int used_count{0};
  double hdop{0.0};  ///< of the satellites used; NaN without a fix
  double latency_s{0.0};
  std::vector<SatelliteReport> satellites;  ///< in the order in which they were passed
};

/// The receiver, epoch by epoch. Everything random comes from streams of the seed; a satellite's noise depends on the
/// seed, its id and the number of epochs since it rose, not on the other satellites.
class Receiver {
 public:
  /// Requires parameters without faults.
  Receiver(const ReceiverParameters& parameters, std::uint64_t seed);

  /// One epoch, `interval_s` > 0 after the last: the antenna's true position (m, map frame) and velocity (m/s) and all
  /// satellites above the horizon. A satellite that is not passed is forgotten.
  ReceiverEpoch epoch(double interval_s, const Eigen::Vector3d& antenna, const Eigen::Vector3d& velocity,
                      const std::vector<ReceivedSatellite>& satellites);

  const ReceiverParameters& parameters() const { return parameters_; }

 private:
  struct Channel {
    RandomEngine engine;
    SatelliteChannel channel;
    std::uint64_t last_epoch;
  };
  void track(double interval_s, const std::vector<ReceivedSatellite>& satellites,
             std::vector<SatelliteReport>& reports);
  /// The ranges that go into the solution, and in measured_ whose they are.
  std::vector<RangeMeasurement> measure(double interval_s, const std::vector<ReceivedSatellite>& satellites,
                                        const std::vector<SatelliteReport>& reports);
  /// Residuals of a solution become those of a position that is `moved` (m) from it, each clock fitted anew.
  void refer_residuals(const std::vector<RangeMeasurement>& measurements, const Eigen::Vector3d& moved,
                       std::vector<SatelliteReport>& reports) const;
  Channel& channel_of(const SatelliteId& id);
  Eigen::Vector3d smoothed(double interval_s, const Eigen::Vector3d& solution);

  ReceiverParameters parameters_;
  std::uint64_t seed_;
  std::uint64_t epoch_{0};
  RandomEngine clock_engine_;
  RandomEngine velocity_engine_;
  RandomEngine latency_engine_;
  std::map<SatelliteId, Channel> channels_;
  std::map<Constellation, double> clocks_m_;
  std::vector<std::size_t> measured_;
  std::optional<Eigen::Vector3d> filtered_;  ///< m, map frame
  Eigen::Vector3d last_velocity_{Eigen::Vector3d::Zero()};
  double without_solution_s_{0.0};
};

}  // namespace urban_gnss
