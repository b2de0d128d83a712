#pragma once

#include <string>

namespace urban_gnss {

/// A topic's name as the ones below are written, however a bag or a user writes it.
inline std::string without_leading_slash(const std::string& topic) {
  return !topic.empty() && topic.front() == '/' ? topic.substr(1) : topic;
}

}  // namespace urban_gnss

/// Names of the graph, relative to the node's namespace. Each stands here once; launch files remap them.
namespace urban_gnss::topics {

inline constexpr char kOdometry[] = "odom";
inline constexpr char kFix[] = "gps/fix";
inline constexpr char kSatellites[] = "gps/satellites";
inline constexpr char kVelocity[] = "gps/velocity";
inline constexpr char kBias[] = "gps/bias";
inline constexpr char kBiasMarkers[] = "gps/bias_markers";
inline constexpr char kDatum[] = "gps/datum";
inline constexpr char kImu[] = "imu/data";
inline constexpr char kInitialPose[] = "initialpose";
inline constexpr char kEstimate[] = "odometry/filtered";
inline constexpr char kFilteredFix[] = "gps/filtered";
inline constexpr char kParticles[] = "particle_cloud";
inline constexpr char kWeightedParticles[] = "particle_cloud_weighted";
inline constexpr char kStatus[] = "status";  ///< private: ~status
inline constexpr char kStatusText[] = "status_text";
inline constexpr char kEllipse[] = "ellipse";
inline constexpr char kEllipses[] = "ellipses";  ///< of all localizers of a comparison
inline constexpr char kCommand[] = "cmd_vel";
inline constexpr char kTargets[] = "targets";
inline constexpr char kTargetPath[] = "targets_path";
inline constexpr char kTruth[] = "ground_truth/odom";
inline constexpr char kTrueFixError[] = "ground_truth/gps_error";
inline constexpr char kTrueShadow[] = "ground_truth/in_shadow";
inline constexpr char kTrueSignals[] = "ground_truth/signal_paths";
inline constexpr char kPoints[] = "points";
inline constexpr char kWeightedFix[] = "gps/fix_weighted";
inline constexpr char kVisibility[] = "gps/visibility";
inline constexpr char kVisibilityMarkers[] = "gps/visibility_markers";
inline constexpr char kSkyPlot[] = "gps/sky_plot";
inline constexpr char kErrorPlot[] = "error_plot";
inline constexpr char kOcclusionMap[] = "occlusion_map";
inline constexpr char kStaticTf[] = "tf_static";  ///< not in the node's namespace: /tf_static
inline constexpr char kWorld[] = "world_markers";

}  // namespace urban_gnss::topics
