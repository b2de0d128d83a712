#pragma once

#include <ros/ros.h>

#include <string>

#include "urban_gnss_localization/common/parameters.hpp"
#include "urban_gnss_localization/pipeline/localization_pipeline.hpp"
#include "urban_gnss_localization/ros/node_shell.hpp"

namespace urban_gnss {

struct ParticlePublisherParameters {
  double particle_cloud_rate{5.0};

  void visit(ParameterVisitor& v) {
    v("particle_cloud_rate", particle_cloud_rate, non_negative(), "Hz",
      "rate, by the stamps, at which particle_cloud and particle_cloud_weighted are published; 0: never");
  }
};

/// Publishes particle_cloud and particle_cloud_weighted of a localizer with particles.
class ParticlePublisher {
 public:
  ParticlePublisher(ros::NodeHandle& node, const ParticlePublisherParameters& parameters, std::string frame);

  /// After an output of the pipeline. Requires a ParticleLocalizer in it.
  void publish(const LocalizationPipeline& pipeline, Stamp stamp, NodeShell& shell);

 private:
  ParticlePublisherParameters parameters_;
  std::string frame_;
  ros::Publisher poses_;
  ros::Publisher cloud_;
  Stamp last_{0};
};

/// Publishes gps/bias and gps/bias_markers of a localizer that estimates the bias itself.
class BiasPublisher {
 public:
  BiasPublisher(ros::NodeHandle& node, std::string frame);

  void publish(LocalizationPipeline& pipeline, NodeShell& shell);

 private:
  std::string frame_;
  ros::Publisher biases_;
  ros::Publisher markers_;
};

}  // namespace urban_gnss
