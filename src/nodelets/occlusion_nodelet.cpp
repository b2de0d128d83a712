// The nodelet urban_gnss_localization/occlusion: OcclusionNode in the process of a lidar's driver.

#include <nodelet/nodelet.h>

#include <memory>
#include <pluginlib/class_list_macros.hpp>

#include "urban_gnss_localization/ros/occlusion_node.hpp"

namespace urban_gnss {

class OcclusionNodelet : public nodelet::Nodelet {
 private:
  /// What is wrong goes on to the manager, which tells the loader that the nodelet is not there and goes on itself.
  void onInit() override {
    try {
      node_ = std::make_unique<OcclusionNode>(getNodeHandle(), getPrivateNodeHandle());
    } catch (const std::exception& error) {
      NODELET_FATAL_STREAM(error.what());
      throw;
    }
  }

  std::unique_ptr<OcclusionNode> node_;
};

}  // namespace urban_gnss

PLUGINLIB_EXPORT_CLASS(urban_gnss::OcclusionNodelet, nodelet::Nodelet)
