#pragma once

#include <diagnostic_updater/diagnostic_updater.h>
#include <geometry_msgs/PoseWithCovarianceStamped.h>
#include <nav_msgs/Odometry.h>
#include <ros/ros.h>
#include <sensor_msgs/Imu.h>
#include <sensor_msgs/NavSatFix.h>
#include <std_srvs/Empty.h>
#include <tf2_ros/transform_broadcaster.h>
#include <topic_tools/shape_shifter.h>
#include <urban_gnss_localization/GpsBias.h>
#include <urban_gnss_localization/SatelliteArray.h>
#include <urban_gnss_localization/SetDatum.h>
#include <urban_gnss_localization/SetPose.h>

#include <functional>
#include <memory>

#include "urban_gnss_localization/pipeline/correction_slew.hpp"
#include "urban_gnss_localization/pipeline/localization_pipeline.hpp"
#include "urban_gnss_localization/ros/conversions.hpp"
#include "urban_gnss_localization/ros/event_log.hpp"
#include "urban_gnss_localization/ros/input_watch.hpp"
#include "urban_gnss_localization/ros/map_services.hpp"
#include "urban_gnss_localization/ros/node_shell.hpp"
#include "urban_gnss_localization/ros/sensor_frames.hpp"
#include "urban_gnss_localization/ros/state_keeper.hpp"
#include "urban_gnss_localization/ros/transform_input.hpp"

namespace urban_gnss {

/// Parameters that every localizer node has beside its filter's.
struct LocalizerNodeParameters {
  Frames frames;
  bool publish_tf{true};
  double transform_time_offset{0.0};
  CorrectionSlewParameters slew;
  bool antenna_offset_from_tf{true};
  SavedStateParameters state;
  LocalizationParameters localization;

  void visit(ParameterVisitor& v) {
    v.include(frames);
    v.basic()("publish_tf", publish_tf, "whether map -> odom is broadcast; false where another localizer does");
    v("transform_time_offset", transform_time_offset, any_number(), "s",
      "time added to the stamp of map -> odom, so that users need not wait for the next");
    v.include(slew);
    v("antenna_offset_from_tf", antenna_offset_from_tf,
      "whether antenna_offset is taken from tf (base_link -> the fix's frame_id) where it is [0, 0]");
    v.group("state", state, "What is believed of ~state_file, where that is set.");
    v.include(localization);
  }
};

/// The shell of every localizer: topics, services, tf, status and diagnostics around a LocalizationPipeline. A
/// localizer node makes its filter and hands it over. Further outputs are published in `on_output`.
///
/// Subscribes odom, gps/fix, initialpose, gps/datum; gps/bias, gps/velocity and gps/satellites where the filter wants
/// them; imu/data where use_imu_yaw_rate is set. Publishes odometry/filtered and gps/filtered, tf map -> odom, ~status,
/// and gps/datum (latched) where it found the datum itself. ~state_file: StateKeeper. Services set_pose, datum, toLL,
/// fromLL, toLLArray, fromLLArray, ~reset.
class LocalizerNode {
 public:
  using OutputHook = std::function<void(const LocalizationOutput&)>;

  LocalizerNode(ros::NodeHandle& node, ros::NodeHandle& private_node, const LocalizerNodeParameters& parameters,
                std::unique_ptr<Localizer> localizer, OutputHook on_output = {});

  const LocalizerNodeParameters& parameters() const { return parameters_; }
  NodeShell& shell() { return io_; }
  LocalizationPipeline& pipeline() { return pipeline_; }

 private:
  void on_odometry(const nav_msgs::Odometry& message);
  void on_fix(const sensor_msgs::NavSatFix& message);
  /// Of either type; roscpp keeps to that of the first message.
  void on_velocity(const topic_tools::ShapeShifter& message);
  void on_satellites(const urban_gnss_localization::SatelliteArray& message);
  void on_imu(const sensor_msgs::Imu& message);
  void on_bias(const urban_gnss_localization::GpsBias& message);
  void on_initial_pose(const geometry_msgs::PoseWithCovarianceStamped& message);
  void on_datum(const sensor_msgs::NavSatFix& message);
  void subscribe(ros::NodeHandle& node);
  void serve(ros::NodeHandle& node, ros::NodeHandle& private_node);
  void set_datum(const urban_gnss_localization::SetDatum::Request& request,
                 urban_gnss_localization::SetDatum::Response& response);
  /// toLL, fromLL, toLLArray, fromLLArray.
  template <class Service>
  void serve_conversion(ros::NodeHandle& node, const std::string& name) {
    services_.push_back(io_.serve<typename Service::Request, typename Service::Response>(
        node, name, [this](auto& request, auto& response) { response = answer(request, pipeline_.frame()); }));
  }

  std::string try_pose(const geometry_msgs::PoseWithCovarianceStamped& message);
  void publish_results();
  void publish_output(const LocalizationOutput& output);
  void publish_datum();
  /// Of the odometry that was used last.
  ros::Time now() const { return to_ros(pipeline_.latest_odometry().value_or(Stamp(0))); }
  void publish_status();
  void look_up_sensors();
  void every_second();
  void every_five_seconds();
  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& status);

  LocalizerNodeParameters parameters_;
  LocalizationPipeline pipeline_;
  OutputHook on_output_;
  EventLog log_;
  NodeShell io_{log_};
  CorrectionSlew slew_;
  SensorFrames sensor_frames_;
  std::uint64_t outputs_{0};

  ros::Publisher estimate_publisher_;
  ros::Publisher fix_publisher_;  ///< the estimate as a fix
  ros::Publisher status_publisher_;
  ros::Publisher ellipse_publisher_;      ///< for rviz
  ros::Publisher status_text_publisher_;  ///< for rviz
  ros::Publisher datum_publisher_;
  std::vector<ros::Subscriber> subscribers_;
  std::vector<ros::ServiceServer> services_;
  StateKeeper state_;
  InputWatch odometry_watch_{log_};
  InputWatch fix_watch_{log_};
  tf2_ros::TransformBroadcaster broadcaster_;
  std::optional<TransformInput> tf_;
  diagnostic_updater::Updater diagnostics_;
  ros::WallTimer second_timer_;
  ros::WallTimer five_second_timer_;
  std::optional<GeodeticPosition> published_datum_;
};

}  // namespace urban_gnss
