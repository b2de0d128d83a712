#pragma once

/// Names of the graph, relative to the node's namespace. Each stands here once; launch files remap them.
namespace urban_gnss::topics {

inline constexpr char kOdometry[] = "odom";
inline constexpr char kFix[] = "gps/fix";
inline constexpr char kBias[] = "gps/bias";
inline constexpr char kBiasMarkers[] = "gps/bias_markers";
inline constexpr char kDatum[] = "gps/datum";
inline constexpr char kImu[] = "imu/data";
inline constexpr char kInitialPose[] = "initialpose";
inline constexpr char kEstimate[] = "odometry/filtered";
inline constexpr char kParticles[] = "particle_cloud";
inline constexpr char kWeightedParticles[] = "particle_cloud_weighted";
inline constexpr char kStatus[] = "status";  ///< private: ~status
inline constexpr char kCommand[] = "cmd_vel";
inline constexpr char kTargets[] = "targets";
inline constexpr char kTargetPath[] = "targets_path";
inline constexpr char kTruth[] = "ground_truth/odom";
inline constexpr char kTrueFixError[] = "ground_truth/gps_error";
inline constexpr char kTrueShadow[] = "ground_truth/in_shadow";
inline constexpr char kWorld[] = "world_markers";

}  // namespace urban_gnss::topics
