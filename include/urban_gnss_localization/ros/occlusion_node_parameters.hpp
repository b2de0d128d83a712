#pragma once

#include <string>

#include "urban_gnss_localization/pipeline/occlusion_queue.hpp"
#include "urban_gnss_localization/ros/conversions.hpp"

namespace urban_gnss {

/// What occlusion_node is told beside OcclusionPipelineParameters and Frames.
struct OcclusionNodeParameters {
  std::string prior_map{""};
  OcclusionQueueParameters queue;
  double map_publish_period{1.0};
  int sky_plot_size{480};

  void visit(ParameterVisitor& v) {
    v.basic()("prior_map", prior_map,
              "prior map, a .pcd file in m east, north and up of map_frame's origin; ~clear_map keeps it; empty: none");
    v.include(queue);
    v("map_publish_period", map_publish_period, positive(), "s",
      "time between publications of the map, while it has subscribers");
    v("sky_plot_size", sky_plot_size, between(50, 4000), "px", "width and height of gps/sky_plot");
  }
};

/// All that occlusion_node is told.
struct OcclusionNodeSettings {
  Frames frames;
  OcclusionPipelineParameters pipeline;
  OcclusionNodeParameters node;

  void visit(ParameterVisitor& v) {
    v.include(frames);
    v.include(pipeline);
    v.include(node);
  }
};

}  // namespace urban_gnss
