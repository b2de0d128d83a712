#pragma once

#include <string>

#include "urban_gnss_localization/common/parameters.hpp"

namespace urban_gnss {

/// Parameters of comparison_node.
struct ComparisonNodeParameters {
  std::string localizers{"particle_filter switching_particle_filter imm_ekf complementary_ekf ukf"};
  double window{120.0};
  double plot_rate{2.0};
  int plot_width{480};
  int plot_height{480};

  void visit(ParameterVisitor& v) {
    v.basic()("localizers", localizers, "namespaces of the estimates that are compared, with spaces between");
    v.basic()("window", window, positive(), "s", "time over which errors are shown and averaged");
    v.basic()("plot_rate", plot_rate, open_between(0.0, 20.0), "Hz", "rate, by the wall clock, of error_plot");
    v.basic()("plot_width", plot_width, between(240, 4000), "pixels", "width of error_plot");
    v.basic()("plot_height", plot_height, between(240, 4000), "pixels", "height of error_plot");
  }
};

}  // namespace urban_gnss
