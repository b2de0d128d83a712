#pragma once

#include <geometry_msgs/PoseArray.h>
#include <geometry_msgs/PoseWithCovariance.h>
#include <geometry_msgs/TransformStamped.h>
#include <geometry_msgs/Twist.h>
#include <nav_msgs/Odometry.h>
#include <nav_msgs/Path.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/NavSatFix.h>
#include <sensor_msgs/PointCloud2.h>
#include <urban_gnss_localization/GpsBias.h>
#include <urban_gnss_localization/LocalizationStatus.h>
#include <urban_gnss_localization/Visibility.h>
#include <visualization_msgs/MarkerArray.h>

#include <string>

/// What a message must hold, whether it comes in or goes out: finite numbers, quaternions of length 1, covariances that
/// are some. Each answers with one sentence that names the field; empty where nothing is wrong. A number that may be
/// NaN by its message's definition is not looked at.
namespace urban_gnss {

std::string message_fault(const geometry_msgs::PoseWithCovariance& pose);
std::string message_fault(const geometry_msgs::TransformStamped& transform);
std::string message_fault(const geometry_msgs::Twist& twist);
std::string message_fault(const nav_msgs::Odometry& odometry);
std::string message_fault(const nav_msgs::Path& path);
/// Of one that has a place; one without (a negative status) may hold anything.
std::string message_fault(const sensor_msgs::NavSatFix& fix);
std::string message_fault(const geometry_msgs::PoseArray& poses);
/// Of fields that are FLOAT32 all.
std::string message_fault(const sensor_msgs::PointCloud2& cloud);
std::string message_fault(const visualization_msgs::Marker& marker);
std::string message_fault(const visualization_msgs::MarkerArray& markers);
std::string message_fault(const urban_gnss_localization::GpsBias& bias);
std::string message_fault(const urban_gnss_localization::Visibility& visibility);
inline std::string message_fault(const urban_gnss_localization::LocalizationStatus&) { return {}; }
inline std::string message_fault(const sensor_msgs::Image&) { return {}; }

}  // namespace urban_gnss
