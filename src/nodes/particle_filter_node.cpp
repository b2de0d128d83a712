// The particle filters as a node. Parameters: LocalizerNodeParameters, ParticleFilterParameters,
// MotionParameters, and the two below; config/particle_filter.yaml documents each.

#include "urban_gnss_localization/localizers/switching/switching_particle_filter.hpp"
#include "urban_gnss_localization/ros/localizer_node.hpp"
#include "urban_gnss_localization/ros/node_parameters.hpp"
#include "urban_gnss_localization/ros/topics.hpp"

using namespace urban_gnss;

namespace {

struct CloudParameters {
  double particle_cloud_rate{5.0};  ///< Hz of stamps at which the particles are published; 0 never

  template <class V>
  void visit(V& v) {
    v("particle_cloud_rate", particle_cloud_rate, non_negative());
  }
  void check(std::vector<std::string>&) const {}
};

class ParticleFilterNode {
 public:
  ParticleFilterNode(ros::NodeHandle& node, ros::NodeHandle& private_node) {
    ParticleFilterParameters filter;
    MotionParameters motion;
    read_private_parameters(private_node, shell_parameters_, filter, motion, cloud_parameters_);
    poses_publisher_ = node.advertise<geometry_msgs::PoseArray>(topics::kParticles, 2);
    cloud_publisher_ = node.advertise<sensor_msgs::PointCloud2>(topics::kWeightedParticles, 2);
    shell_ =
        std::make_unique<LocalizerNode>(node, private_node, shell_parameters_, make_particle_filter(filter, motion),
                                        [this](const LocalizationOutput& output) { publish_particles(output); });
  }

 private:
  void publish_particles(const LocalizationOutput& output) {
    const bool went_back = output.stamp < last_published_;
    if (cloud_parameters_.particle_cloud_rate <= 0.0 ||
        (!went_back && to_seconds(output.stamp - last_published_) < 1.0 / cloud_parameters_.particle_cloud_rate)) {
      return;
    }
    last_published_ = output.stamp;
    const ros::Time time = to_ros(output.stamp);
    const std::string& frame = shell_parameters_.frames.map;
    const auto& filter = dynamic_cast<const ParticleLocalizer&>(shell_->pipeline().localizer());
    if (poses_publisher_.getNumSubscribers() > 0) {
      poses_publisher_.publish(to_pose_array(filter.particles(), time, frame));
    }
    if (cloud_publisher_.getNumSubscribers() > 0) {
      cloud_publisher_.publish(to_point_cloud(filter.particles(), time, frame));
    }
  }

  LocalizerNodeParameters shell_parameters_;
  CloudParameters cloud_parameters_;
  ros::Publisher poses_publisher_;
  ros::Publisher cloud_publisher_;
  Stamp last_published_{0};
  std::unique_ptr<LocalizerNode> shell_;
};

}  // namespace

int main(int argc, char** argv) {
  return run_node(argc, argv, "particle_filter", [](ros::NodeHandle& node, ros::NodeHandle& private_node) {
    return std::make_shared<ParticleFilterNode>(node, private_node);
  });
}
