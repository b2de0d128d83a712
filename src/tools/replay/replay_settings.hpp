#pragma once

#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "urban_gnss_localization/localizers/registry.hpp"
#include "urban_gnss_localization/ros/gps_bias_node_parameters.hpp"
#include "urban_gnss_localization/ros/occlusion_node_parameters.hpp"
#include "urban_gnss_localization/ros/registered_localizer_node.hpp"
#include "urban_gnss_localization/ros/topics.hpp"

namespace urban_gnss {

/// The topic of transforms that move, in whatever namespace a node is.
inline constexpr char kTf[] = "tf";

/// What the command line says.
struct ReplayOptions {
  std::vector<std::string> bags;  ///< of one recording
  std::string localizer = kDefaultLocalizer;
  std::string robot;  ///< a file of config/robots; empty: the defaults, which are those of `differential`
  std::vector<std::string> params;
  std::vector<std::string> overrides;
  std::string output;
  std::string fix_topic = topics::kFix;
  std::string odom_topic = topics::kOdometry;
  std::string imu_topic = topics::kImu;
  bool wants_imu = false;  ///< imu_topic was asked for
  std::string velocity_topic = topics::kVelocity;
  bool wants_velocity = false;  ///< velocity_topic was asked for
  std::string satellites_topic = topics::kSatellites;
  bool wants_satellites = false;  ///< satellites_topic was asked for
  std::string truth_topic = topics::kTruth;
  std::string receiver = "navsatfix";  ///< a name of receiver_presets()
  std::string receiver_ns;             ///< empty: to be found
  bool without_odometry = false;       ///< --odom none
  std::string nmea;                    ///< a log that takes the place of the bag's fixes, velocities and satellites
  std::string nmea_date;               ///< of its first sentence, YYYY-MM-DD; empty: its own
  bool occlusion = false;              ///< the fixes are weighed by the occlusion node's pipeline
  std::string points_topic = topics::kPoints;
  std::string occlusion_params;  ///< a file of the occlusion node's parameters, without a section
  std::vector<double> datum;
  double start_s = 0.0;  ///< into the bag
  double duration_s = std::numeric_limits<double>::infinity();
  int seed = -1;
  std::string json_file;
  std::string tum_file;
};

/// What the live localizer, the live bias node and the live occlusion node read.
struct ReplaySettings {
  LocalizerNodeSettings localizer;
  GpsBiasNodeParameters gps_bias;
  std::optional<OcclusionNodeSettings> occlusion;  ///< nothing without --occlusion
  int seed{1};                                     ///< of the localizer's random numbers, where it has some
};

/// Reads the files of --params in their order, later values over earlier ones, then --set and the other options. A file
/// has a section for each node, as localization.launch takes it (`imm_ekf:`, `gps_bias:`, `occlusion:`). Throws
/// std::runtime_error, ParameterError where a name or a value is not known.
ReplaySettings read_settings(const ReplayOptions& options, const LocalizerRegistry& localizers);

}  // namespace urban_gnss
