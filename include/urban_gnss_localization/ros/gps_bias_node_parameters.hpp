#pragma once

#include "urban_gnss_localization/pipeline/bias_pipeline.hpp"
#include "urban_gnss_localization/ros/conversions.hpp"

namespace urban_gnss {

/// Parameters of gps_bias_node. What it shares with the localizer (InputParameters) has the same names there.
struct GpsBiasNodeParameters {
  Frames frames;
  BiasPipelineParameters bias;

  void visit(ParameterVisitor& v) {
    v.include(frames);
    v.include(bias);
  }
};

}  // namespace urban_gnss
