#pragma once

#include <visualization_msgs/MarkerArray.h>

#include <string>
#include <vector>

#include "urban_gnss_localization/geometry/pose2.hpp"
#include "urban_gnss_localization/simulation/lidar.hpp"
#include "urban_gnss_localization/simulation/obstacles.hpp"
#include "urban_gnss_localization/simulation/route.hpp"
#include "urban_gnss_localization/simulation/simulator.hpp"
#include "urban_gnss_localization/simulation/world.hpp"

/// What rviz shows of a simulated city.
namespace urban_gnss {

/// What does not move: ground, buildings, trees, and the route as a line.
visualization_msgs::MarkerArray world_markers(const World& world, const Route& route, const ros::Time& time,
                                              const std::string& map_frame);

/// The true robot as the box of its body, and the cars about it.
visualization_msgs::MarkerArray traffic_markers(const Pose2& truth, const LidarParameters& body,
                                                const std::vector<Car>& cars, double time_s, const ros::Time& time,
                                                const std::string& map_frame);

/// A ray for each satellite along the way of its signal: green for the line of sight, yellow for a line of sight with
/// multipath, red for a signal without it, grey and thin for none, with the satellite's name at the end.
visualization_msgs::MarkerArray signal_markers(const SignalsEvent& signals, const ros::Time& time,
                                               const std::string& map_frame);

/// The fix as a ball on a disc of two claimed standard deviations, and a line from it to the true antenna.
visualization_msgs::MarkerArray fix_markers(const ReceiverFix& fix, const Eigen::Vector3d& error, const ros::Time& time,
                                            const std::string& map_frame);

}  // namespace urban_gnss
