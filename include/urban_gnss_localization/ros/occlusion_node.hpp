#pragma once

#include <diagnostic_updater/diagnostic_updater.h>
#include <nav_msgs/Odometry.h>
#include <ros/ros.h>
#include <std_srvs/Trigger.h>
#include <tf2_ros/transform_listener.h>
#include <urban_gnss_localization/SaveMap.h>

#include <cstddef>
#include <deque>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "urban_gnss_localization/pipeline/stamp_monitor.hpp"
#include "urban_gnss_localization/ros/conversions.hpp"
#include "urban_gnss_localization/ros/input_watch.hpp"
#include "urban_gnss_localization/ros/visibility_messages.hpp"

namespace urban_gnss {

/// What the node is told beside OcclusionPipelineParameters and Frames.
struct OcclusionNodeParameters {
  std::string prior_map{""};
  double tf_timeout{0.5};
  int cloud_queue{5};
  double time_jump{1.0};
  double map_publish_period{1.0};
  int sky_plot_size{480};

  void visit(ParameterVisitor& v) {
    v.basic()("prior_map", prior_map,
              "prior map, a .pcd file in m east, north and up of map_frame's origin; ~clear_map keeps it; empty: none");
    v("tf_timeout", tf_timeout, non_negative(), "s",
      "time, by the fixes' stamps, that a cloud or a fix waits for its transform");
    v("cloud_queue", cloud_queue, between(1, 1000), "",
      "greatest number of clouds that wait; beyond it the oldest is dropped");
    v("time_jump", time_jump, positive(), "s",
      "difference by which a stamp must be older than the last for its clock to count as set back");
    v("map_publish_period", map_publish_period, positive(), "s",
      "time between publications of the map, while it has subscribers");
    v("sky_plot_size", sky_plot_size, between(50, 4000), "px", "width and height of gps/sky_plot");
  }
};

/// All that the node is told.
struct OcclusionNodeSettings {
  Frames frames;
  OcclusionPipelineParameters pipeline;
  OcclusionNodeParameters node;

  void visit(ParameterVisitor& v) {
    v.include(frames);
    v.include(pipeline);
    v.include(node);
  }
};

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
  std::optional<geometry_msgs::TransformStamped> look_up(const std::string& to, const std::string& from,
                                                         const ros::Time& time);
  std::optional<Eigen::Isometry3d> transform(const std::string& to, const std::string& from, const ros::Time& time);

  void on_cloud(const sensor_msgs::PointCloud2ConstPtr& message);
  void on_satellites(const urban_gnss_localization::SatelliteArray& message);
  void on_estimate(const nav_msgs::Odometry& message);
  void on_fix(const sensor_msgs::NavSatFixConstPtr& message);
  void start_anew();
  void forget_former_clock();

  bool is_overdue(const ros::Time& stamp) const;
  void work();
  void update_alignment();
  bool insert(const sensor_msgs::PointCloud2& message);
  void report(const CloudOutcome& outcome);
  bool assess(const sensor_msgs::NavSatFixConstPtr& message);
  void publish(const sensor_msgs::NavSatFix& message, const FixAssessment& assessment);
  bool tf_is_there() const;
  void place_antenna(const sensor_msgs::NavSatFix& message);
  void publish_map();
  bool clear_map(std_srvs::Trigger::Request& request, std_srvs::Trigger::Response& response);
  bool save_map(urban_gnss_localization::SaveMap::Request& request,
                urban_gnss_localization::SaveMap::Response& response);
  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& status);

  Frames frames_;
  OcclusionNodeParameters parameters_;
  std::unique_ptr<OcclusionPipeline> pipeline_;
  PointCloud prior_;
  bool prior_is_in_{false};
  tf2_ros::Buffer tf_buffer_;
  tf2_ros::TransformListener tf_listener_;
  StampMonitor fix_stamps_;
  std::deque<sensor_msgs::PointCloud2ConstPtr> clouds_;
  std::deque<sensor_msgs::NavSatFixConstPtr> fixes_;
  ros::Time newest_;  ///< stamp of the fixes: one of the future is a set-back clock at the next, a cloud's would stay
  ros::Time former_newest_;  ///< that of before the clock was set back
  double yaw_sigma_{0.0};  ///< NaN where the localizer does not know the heading
  bool antenna_known_{false};
  InputWatch fix_watch_;
  std::string tf_fault_;
  std::string missing_;
  std::string doubt_;
  std::string last_alignment_{"none"};
  VisibilitySource source_{VisibilitySource::kNone};
  std::size_t fixes_assessed_{0};
  std::size_t clouds_received_{0};
  std::size_t clouds_inserted_{0};
  std::size_t clouds_dropped_{0};
  std::size_t alignments_tried_{0};
  std::size_t alignments_accepted_{0};
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
  ros::ServiceServer clear_service_;
  ros::ServiceServer save_service_;
  ros::WallTimer work_timer_;
  ros::WallTimer second_timer_;
  ros::WallTimer map_timer_;
};

}  // namespace urban_gnss
