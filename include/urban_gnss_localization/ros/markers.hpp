#pragma once

#include <visualization_msgs/Marker.h>
#include <visualization_msgs/MarkerArray.h>

#include <string>
#include <vector>

#include "urban_gnss_localization/geometry/pose2.hpp"
#include "urban_gnss_localization/localizers/bias_estimate.hpp"
#include "urban_gnss_localization/pipeline/status_reporter.hpp"
#include "urban_gnss_localization/ros/marker_parts.hpp"

namespace urban_gnss {

/// status_line() above the robot, as rviz's text: green, amber or red. It goes along with the base's frame.
visualization_msgs::Marker status_marker(const LocalizationReport& report, const std::string& base_link_frame);

/// The ellipse that holds the position with 95 %, if the estimate's covariance is right, as a line. rviz's own, one
/// sigma, is drawn three-dimensional: the height's variance makes it a column, of which the shadow is seen.
visualization_msgs::Marker ellipse_marker(const PoseEstimate& estimate, Colour colour, int id, const ros::Time& time,
                                          const std::string& map_frame);

/// The ring of radius r-hat about the predicted antenna (where the fix may lie in the shadow), orange in the shadow and
/// green otherwise; the bias as an arrow from there; and the fix itself as a ball, yellow, or red where it was
/// rejected.
visualization_msgs::MarkerArray bias_markers(const BiasEstimate& bias, const std::string& map_frame);

/// The targets as numbered discs, the current one highlighted.
visualization_msgs::MarkerArray target_markers(const std::vector<Eigen::Vector2d>& targets, std::size_t current,
                                               const ros::Time& time, const std::string& map_frame);

/// The shadow as a dark plate over the half-plane x < border within `extent_m` of the origin, and the true robot as a
/// box of one wheelbase.
visualization_msgs::MarkerArray field_markers(double shadow_border_m, double extent_m, const Pose2& truth,
                                              double wheelbase_m, const ros::Time& time, const std::string& map_frame);

}  // namespace urban_gnss
