#pragma once

#include <diagnostic_updater/diagnostic_updater.h>
#include <nav_msgs/Odometry.h>
#include <ros/ros.h>
#include <sensor_msgs/Imu.h>
#include <std_srvs/Trigger.h>
#include <urban_gnss_localization/SaveMap.h>

#include <memory>
#include <string>

#include "urban_gnss_localization/ros/input_watch.hpp"
#include "urban_gnss_localization/ros/node_shell.hpp"
#include "urban_gnss_localization/ros/occlusion_node_parameters.hpp"
#include "urban_gnss_localization/ros/tf_frames.hpp"
#include "urban_gnss_localization/ros/transform_input.hpp"
#include "urban_gnss_localization/ros/visibility_messages.hpp"

namespace urban_gnss {

/// Weighs fixes by what stands between the antenna and the satellites (Maier & Kleiner 2010): points, gps/satellites,
/// gps/fix, odometry/filtered and tf in; gps/fix_weighted, gps/visibility, the map, rays and a sky plot out; services
/// ~clear_map and ~save_map. occlusion_node and the nodelet urban_gnss_localization/occlusion are thin shells around
/// it.
///
/// Messages are taken and given as shared pointers: in one process with the lidar's driver no cloud is copied.
class OcclusionNode {
 public:
  /// Both handles must have the same callback queue, of which one thread takes at a time. Throws ParameterError with
  /// every fault, std::runtime_error where prior_map cannot be read.
  OcclusionNode(ros::NodeHandle& node, ros::NodeHandle& private_node);
  ~OcclusionNode();
  OcclusionNode(const OcclusionNode&) = delete;
  OcclusionNode& operator=(const OcclusionNode&) = delete;

 private:
  void on_cloud(const sensor_msgs::PointCloud2ConstPtr& message);
  void on_satellites(const urban_gnss_localization::SatelliteArray& message);
  void on_estimate(const nav_msgs::Odometry& message);
  void on_imu(const sensor_msgs::Imu& message);
  void on_fix(const sensor_msgs::NavSatFixConstPtr& message);
  void subscribe(ros::NodeHandle& node, bool takes_imu);
  void settle_fixes();
  void work();
  void every_second();
  void every_five_seconds();
  std::string what_is_awaited() const;
  void publish(const sensor_msgs::NavSatFixConstPtr& message, const FixAssessment* assessment);
  void publish_map();
  void clear_map(std_srvs::Trigger::Response& response);
  void save_map(const urban_gnss_localization::SaveMap::Request& request,
                urban_gnss_localization::SaveMap::Response& response);
  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& status);

  Frames frames_;
  OcclusionNodeParameters parameters_;
  EventLog log_;
  NodeShell io_{log_};
  TransformInput tf_;
  TfFrames transforms_;
  bool has_prior_map_{false};
  std::unique_ptr<OcclusionQueue> queue_;
  InputWatch fix_watch_{log_};
  diagnostic_updater::Updater diagnostics_;
  ros::Publisher fix_publisher_;
  ros::Publisher visibility_publisher_;
  ros::Publisher marker_publisher_;
  ros::Publisher sky_publisher_;
  ros::Publisher map_publisher_;
  // Last, so that their callbacks have ended before anything else goes: a nodelet is unloaded from another thread.
  ros::Subscriber fix_subscriber_;
  ros::Subscriber satellites_subscriber_;
  ros::Subscriber cloud_subscriber_;
  ros::Subscriber estimate_subscriber_;
  ros::Subscriber imu_subscriber_;
  ros::ServiceServer clear_service_;
  ros::ServiceServer save_service_;
  ros::WallTimer work_timer_;
  ros::WallTimer second_timer_;
  ros::WallTimer five_second_timer_;
  ros::WallTimer map_timer_;
};

}  // namespace urban_gnss
