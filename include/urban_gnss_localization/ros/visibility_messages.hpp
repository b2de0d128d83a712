#pragma once

#include <sensor_msgs/Image.h>
#include <sensor_msgs/NavSatFix.h>
#include <sensor_msgs/PointCloud2.h>
#include <urban_gnss_localization/SatelliteArray.h>
#include <urban_gnss_localization/Visibility.h>
#include <visualization_msgs/MarkerArray.h>

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "urban_gnss_localization/pipeline/occlusion_queue.hpp"
#include "urban_gnss_localization/ros/conversions.hpp"

/// Between messages and the occlusion pipeline.
namespace urban_gnss {

/// The points of a cloud with fields x, y and z, in whatever place and order, as 32- or 64-bit floating point numbers;
/// points that are not finite are kept. Throws std::invalid_argument that names what is wrong: a field missing or of
/// another type, big-endian data, less data than height and row_step say.
PointCloud to_point_cloud(const sensor_msgs::PointCloud2& message);
OcclusionFrames to_occlusion_frames(const Frames& frames);
sensor_msgs::PointCloud2 to_message(const PointCloud& cloud, const ros::Time& time, const std::string& frame);

std::vector<SatelliteObservation> to_observations(const urban_gnss_localization::SatelliteArray& message);

/// The cloud, converted when its turn comes.
QueuedCloud to_queued_cloud(const sensor_msgs::PointCloud2ConstPtr& message);
QueuedFix to_queued_fix(const sensor_msgs::NavSatFixConstPtr& message,
                        std::function<void(const FixAssessment*)> settle);

/// The receiver's claim, east and north, m^2; nothing where it has none that can be used.
std::optional<Eigen::Matrix2d> claimed_covariance(const sensor_msgs::NavSatFix& fix);

/// The fix with the weighted covariance in the place of the receiver's; the height's variance grows by the same factor
/// as the horizontal ones.
sensor_msgs::NavSatFix weighted_fix(const sensor_msgs::NavSatFix& fix, const GnssCovariance& covariance);

/// The fix as one without a place: no status, nothing non-finite, no covariance.
sensor_msgs::NavSatFix fix_without_place(const sensor_msgs::NavSatFix& fix);

urban_gnss_localization::Visibility to_message(const FixAssessment& assessment,
                                               const std::optional<Eigen::Matrix2d>& claimed,
                                               const GnssCovarianceParameters& parameters, const ros::Time& time,
                                               const std::string& frame);

/// Rays to the satellites from the antenna, in the frame of the map of the surroundings: green free, orange blocked (up
/// to what blocks), grey unknown.
visualization_msgs::MarkerArray ray_markers(const FixAssessment& assessment,
                                            const urban_gnss_localization::Visibility& visibility,
                                            const ros::Time& time, const std::string& frame);

/// The sky with north up and east right, zenith in the middle: what the map blocks dark (`skyline`, rad, by equal steps
/// of azimuth; empty without a map), satellites as discs with their names, in the colours of ray_markers() (white: not
/// received), 8-bit RGB, `size` pixels square.
sensor_msgs::Image sky_plot(const urban_gnss_localization::Visibility& visibility, const std::vector<double>& skyline,
                            int size);

}  // namespace urban_gnss
