#include "urban_gnss_localization/ros/localizer_publishers.hpp"

#include <geometry_msgs/PoseArray.h>
#include <sensor_msgs/PointCloud2.h>
#include <urban_gnss_localization/GpsBias.h>
#include <visualization_msgs/MarkerArray.h>

#include "urban_gnss_localization/localizers/particle_localizer.hpp"
#include "urban_gnss_localization/ros/conversions.hpp"
#include "urban_gnss_localization/ros/markers.hpp"
#include "urban_gnss_localization/ros/topics.hpp"

namespace urban_gnss {

ParticlePublisher::ParticlePublisher(ros::NodeHandle& node, const ParticlePublisherParameters& parameters,
                                     std::string frame)
    : parameters_(parameters),
      frame_(std::move(frame)),
      poses_(node.advertise<geometry_msgs::PoseArray>(topics::kParticles, 2)),
      cloud_(node.advertise<sensor_msgs::PointCloud2>(topics::kWeightedParticles, 2)) {}

void ParticlePublisher::publish(const LocalizationPipeline& pipeline, Stamp stamp, NodeShell& shell) {
  const bool went_back = stamp < last_;
  if (parameters_.particle_cloud_rate <= 0.0 ||
      (!went_back && to_seconds(stamp - last_) < 1.0 / parameters_.particle_cloud_rate)) {
    return;
  }
  last_ = stamp;
  const ros::Time time = to_ros(stamp);
  const ParticleSet& particles = dynamic_cast<const ParticleLocalizer&>(pipeline.localizer()).particles();
  if (poses_.getNumSubscribers() > 0) shell.publish(poses_, to_pose_array(particles, time, frame_));
  if (cloud_.getNumSubscribers() > 0) shell.publish(cloud_, to_point_cloud(particles, time, frame_));
}

BiasPublisher::BiasPublisher(ros::NodeHandle& node, std::string frame)
    : frame_(std::move(frame)),
      biases_(node.advertise<urban_gnss_localization::GpsBias>(topics::kBias, 100)),
      markers_(node.advertise<visualization_msgs::MarkerArray>(topics::kBiasMarkers, 2)) {}

void BiasPublisher::publish(LocalizationPipeline& pipeline, NodeShell& shell) {
  for (const BiasEstimate& bias : pipeline.take_bias_estimates()) {
    shell.publish(biases_, to_message(bias, frame_));
    if (markers_.getNumSubscribers() > 0) shell.publish(markers_, bias_markers(bias, frame_));
  }
}

}  // namespace urban_gnss
