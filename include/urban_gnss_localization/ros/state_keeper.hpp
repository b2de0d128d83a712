#pragma once

#include <ros/node_handle.h>

#include <string>

#include "urban_gnss_localization/pipeline/localization_pipeline.hpp"
#include "urban_gnss_localization/ros/conversions.hpp"
#include "urban_gnss_localization/ros/event_log.hpp"

namespace urban_gnss {

/// The private parameter of a localizer's node that names the file of its state.
inline constexpr char kStateFile[] = "state_file";

/// Keeps the state of a localizer in the file ~state_file, an absolute path, of this node alone; does nothing where
/// that is empty or not set. A file that cannot be read, or is of other frames, is left as it is until there is a state
/// to be saved.
class StateKeeper {
 public:
  /// Throws ParameterError where ~state_file cannot be one.
  StateKeeper(const ros::NodeHandle& private_node, const Frames& frames, EventLog& log);

  /// Gives the pipeline what the file has, to go on from, or says why not.
  void restore(LocalizationPipeline& pipeline, const SavedStateParameters& parameters);
  /// Writes the pipeline's state, where there is one of newer odometry than before. Says where that cannot be done.
  void save(const LocalizationPipeline& pipeline);
  /// For people: whether it is kept.
  const std::string& news() const { return news_; }

 private:
  Frames frames_;
  EventLog& log_;
  std::string file_;
  Stamp saved_{-1};
  std::string news_{"state_file is not set"};
};

}  // namespace urban_gnss
