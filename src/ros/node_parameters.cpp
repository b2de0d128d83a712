#include "urban_gnss_localization/ros/node_parameters.hpp"

#include <ros/callback_queue.h>
#include <ros/ros.h>

#include "urban_gnss_localization/parameters/params_file.hpp"
#include "urban_gnss_localization/ros/event_log.hpp"

namespace urban_gnss {
namespace {

YAML::Node to_yaml(XmlRpc::XmlRpcValue& value) {
  switch (value.getType()) {
    case XmlRpc::XmlRpcValue::TypeBoolean: return YAML::Node(static_cast<bool>(value));
    case XmlRpc::XmlRpcValue::TypeInt: return YAML::Node(static_cast<int>(value));
    case XmlRpc::XmlRpcValue::TypeDouble: return YAML::Node(static_cast<double>(value));
    case XmlRpc::XmlRpcValue::TypeString: return YAML::Node(static_cast<std::string>(value));
    case XmlRpc::XmlRpcValue::TypeArray: {
      YAML::Node list(YAML::NodeType::Sequence);
      for (int i = 0; i < value.size(); ++i) list.push_back(to_yaml(value[i]));
      return list;
    }
    case XmlRpc::XmlRpcValue::TypeStruct: {
      YAML::Node map(YAML::NodeType::Map);
      for (auto& entry : value) map[entry.first] = to_yaml(entry.second);
      return map;
    }
    default: return YAML::Node();
  }
}

/// What a callback throws ends no node. NodeShell catches and counts; this is for callbacks that have none.
void spin_some() {
  try {
    ros::getGlobalCallbackQueue()->callAvailable(ros::WallDuration(0.1));
  } catch (const std::exception& error) {
    ROS_ERROR_STREAM("a callback failed: " << log_line(error.what()));
  }
}

}  // namespace

YAML::Node private_parameters(const ros::NodeHandle& private_node) {
  XmlRpc::XmlRpcValue value;
  if (!private_node.getParam(private_node.getNamespace(), value)) return YAML::Node();
  return to_yaml(value);
}

ParameterReader private_parameter_reader(const ros::NodeHandle& private_node) {
  ParameterReader reader(private_parameters(private_node), "", "", Layout::kTiered);
  reader.ignore("diagnostic_period");  // diagnostic_updater's own
  reader.ignore("params_file");        // finish_reading() looks through it
  return reader;
}

void finish_reading(const ros::NodeHandle& private_node, const ParameterReader& reader) {
  std::vector<std::string> faults = reader.finish();
  const std::string file = private_node.param<std::string>("params_file", "");
  if (!file.empty()) {
    const std::string path = private_node.getNamespace();
    try {
      const ParamsFile found = read_params_file(file, {path.substr(path.rfind('/') + 1)});
      faults.insert(faults.end(), found.faults.begin(), found.faults.end());
      if (!found.hint.empty()) ROS_WARN_STREAM(found.hint);
    } catch (const std::exception& error) {
      faults.push_back(error.what());
    }
  }
  if (!faults.empty()) throw ParameterError(private_node.getNamespace(), faults);
}

int run_node(int argc, char** argv, const std::string& name,
             const std::function<std::shared_ptr<void>(ros::NodeHandle&, ros::NodeHandle&)>& make) {
  ros::init(argc, argv, name);
  ros::NodeHandle node;
  ros::NodeHandle private_node("~");
  try {
    const std::shared_ptr<void> alive = make(node, private_node);
    while (ros::ok()) spin_some();
  } catch (const std::exception& error) {
    ROS_FATAL_STREAM(error.what());
    return 1;
  }
  return 0;
}

}  // namespace urban_gnss
