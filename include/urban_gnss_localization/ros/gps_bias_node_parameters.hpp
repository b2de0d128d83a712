#pragma once

#include <string>

#include "urban_gnss_localization/pipeline/bias_pipeline.hpp"
#include "urban_gnss_localization/ros/conversions.hpp"

namespace urban_gnss {

/// Parameters of gps_bias_node. What it shares with the localizer, frames, InputParameters and the mode, is taken from
/// the parameters of the node `localizer` where it is not given here.
struct GpsBiasNodeParameters {
  std::string localizer;
  Frames frames;
  BiasPipelineParameters bias;

  void visit(ParameterVisitor& v) {
    v.basic()("localizer", localizer,
              "name of the localizer's node, whose frames, antenna, mode and fix validation apply here; empty: the "
              "defaults");
    v.include(frames);
    v.include(bias);
  }
};

}  // namespace urban_gnss
