#pragma once

#include <string>

#include "urban_gnss_localization/receivers/gpsd_decoder.hpp"

namespace urban_gnss {

/// What gpsd_node reads.
struct GpsdNodeParameters {
  std::string host{"localhost"};
  int port{2947};
  std::string frame{"gps"};
  GpsdParameters gpsd;
  double settle_time{0.2};
  double reconnect_period{1.0};

  void visit(ParameterVisitor& v) {
    v.basic()("host", host, "where gpsd runs: a name or an address");
    v.basic()("port", port, between(1, 65535), "", "its port");
    v.basic()("frame_id", frame, "of what is published: the antenna's frame");
    v.include(gpsd);
    v("settle_time", settle_time, between(0.01, 5.0), "s",
      "silence after which a solution is taken as complete; shorter than the pause between two solutions");
    v("reconnect_period", reconnect_period, between(0.1, 60.0), "s", "between two attempts to reach gpsd");
  }
  void check(std::vector<std::string>& faults) const {
    if (host.empty()) faults.push_back("host: must not be empty");
  }
};

}  // namespace urban_gnss
