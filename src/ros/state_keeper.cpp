#include "urban_gnss_localization/ros/state_keeper.hpp"

#include <stdexcept>

namespace urban_gnss {
namespace {

/// Empty where it is not set. Throws ParameterError.
std::string file_of(const ros::NodeHandle& private_node) {
  XmlRpc::XmlRpcValue value;
  if (!private_node.getParam(kStateFile, value)) return {};
  std::string fault = "state_file: must be a text";
  std::string file;
  if (value.getType() == XmlRpc::XmlRpcValue::TypeString) {
    file = static_cast<std::string>(value);
    fault = file.empty() ? "" : state_file_fault(file);
  }
  if (!fault.empty()) throw ParameterError(private_node.getNamespace(), {fault});
  return file;
}

std::string frame_fault(const char* name, const std::string& saved, const std::string& frame) {
  return saved == frame ? "" : "its " + std::string(name) + " is '" + saved + "', must be '" + frame + "'";
}

}  // namespace

StateKeeper::StateKeeper(const ros::NodeHandle& private_node, const Frames& frames, EventLog& log)
    : frames_(frames), log_(log), file_(file_of(private_node)) {
  if (!file_.empty()) news_ = "nothing to be saved yet";
}

void StateKeeper::restore(LocalizationPipeline& pipeline, const SavedStateParameters& parameters) {
  if (file_.empty()) return;
  std::string fault;
  try {
    const auto state = read_state(file_);
    if (!state) return;
    fault = frame_fault("map_frame", state->map_frame, frames_.map);
    if (fault.empty()) fault = frame_fault("base_link_frame", state->base_link_frame, frames_.base_link);
    if (fault.empty()) pipeline.restore(*state, parameters);
  } catch (const std::invalid_argument& error) {
    fault = error.what();
  }
  if (!fault.empty()) log_.warn("saved state left out: " + file_ + ": " + fault);
}

void StateKeeper::save(const LocalizationPipeline& pipeline) {
  if (file_.empty()) return;
  auto state = pipeline.state();
  if (!state || state->stamp == saved_) return;
  state->map_frame = frames_.map;
  state->base_link_frame = frames_.base_link;
  try {
    write_state(file_, *state);
    saved_ = state->stamp;
    news_ = "kept in " + file_;
  } catch (const std::runtime_error& error) {
    news_ = std::string("not saved: ") + error.what();
    log_.warn("state " + news_);
  }
}

}  // namespace urban_gnss
