#include "urban_gnss_localization/ros/registered_localizer_node.hpp"

#include "urban_gnss_localization/localizers/registry.hpp"
#include "urban_gnss_localization/ros/node_parameters.hpp"
#include "urban_gnss_localization/ros/run_localizer_node.hpp"

namespace urban_gnss {

RegisteredLocalizerNode::RegisteredLocalizerNode(ros::NodeHandle& node, ros::NodeHandle& private_node,
                                                 const LocalizerEntry& entry) {
  LocalizerNodeSettings settings(entry);
  ParameterReader reader = private_parameter_reader(private_node);
  reader.ignore(kStateFile);  // StateKeeper reads it
  reader.read(settings);
  finish_reading(private_node, reader);
  std::unique_ptr<Localizer> localizer = settings.localizer->make();
  const std::string& frame = settings.shell.frames.map;
  if (settings.has_particles) particles_.emplace(node, settings.particles, frame);
  if (localizer->estimates_bias()) bias_.emplace(node, frame);
  shell_ = std::make_unique<LocalizerNode>(node, private_node, settings.shell, std::move(localizer),
                                           [this](const LocalizationOutput& output) { publish(output); });
}

void RegisteredLocalizerNode::publish(const LocalizationOutput& output) {
  if (!shell_) return;  // its constructor publishes what there is
  if (particles_) particles_->publish(shell_->pipeline(), output.stamp, shell_->shell());
  if (bias_) bias_->publish(shell_->pipeline(), shell_->shell());
}

int run_localizer_node(int argc, char** argv, const std::string& name) {
  return run_node(argc, argv, name, [&](ros::NodeHandle& node, ros::NodeHandle& private_node) {
    return std::make_shared<RegisteredLocalizerNode>(node, private_node, standard_localizers().find(name));
  });
}

}  // namespace urban_gnss
