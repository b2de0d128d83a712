#pragma once

#include <memory>
#include <optional>
#include <string>

#include "urban_gnss_localization/localizers/localizer_entry.hpp"
#include "urban_gnss_localization/ros/localizer_node.hpp"
#include "urban_gnss_localization/ros/localizer_publishers.hpp"

namespace urban_gnss {

/// The node of a localizer of the registry. Parameters: LocalizerNodeParameters and the localizer's settings
/// (docs/parameters.md); where it has particles, also ParticlePublisherParameters. Publishes what LocalizerNode does,
/// the particles where it has some, and gps/bias where it estimates the bias itself.
class RegisteredLocalizerNode {
 public:
  /// Throws ParameterError where a parameter is bad.
  RegisteredLocalizerNode(ros::NodeHandle& node, ros::NodeHandle& private_node, const LocalizerEntry& entry);

  LocalizationPipeline& pipeline() { return shell_->pipeline(); }
  NodeShell& shell() { return shell_->shell(); }

 private:
  void publish(const LocalizationOutput& output);

  std::optional<ParticlePublisher> particles_;
  std::optional<BiasPublisher> bias_;
  std::unique_ptr<LocalizerNode> shell_;
};

/// What a localizer's node reads, with its defaults: for documentation and for the YAML files.
struct LocalizerNodeSettings {
  explicit LocalizerNodeSettings(const LocalizerEntry& entry)
      : localizer(entry.settings()), has_particles(entry.has_particles) {}

  LocalizerNodeParameters shell;
  std::shared_ptr<LocalizerSettings> localizer;
  bool has_particles;
  ParticlePublisherParameters particles;

  void visit(ParameterVisitor& v) {
    v.include(shell);
    v.include(*localizer);
    if (has_particles) v.include(particles);
  }
};

}  // namespace urban_gnss
