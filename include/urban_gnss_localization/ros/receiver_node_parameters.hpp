#pragma once

#include <stdexcept>
#include <string>

#include "urban_gnss_localization/common/parameters.hpp"
#include "urban_gnss_localization/receivers/receiver_presets.hpp"

namespace urban_gnss {

/// What receiver_node reads.
struct ReceiverNodeParameters {
  std::string receiver{"ublox"};
  std::string ns;
  std::string frame;

  void visit(ParameterVisitor& v) {
    v.basic()("receiver", receiver,
              "whose driver's messages are taken: ublox, gpsd, nmea, septentrio, novatel, mavros");
    v.basic()("namespace", ns, "where the driver's topics are, / for the root; empty: where the driver has them");
    v.basic()("frame_id", frame, "of what is published: the antenna's frame; empty: as the driver's fixes have it");
  }
  void check(std::vector<std::string>& faults) const {
    try {
      if (find_receiver_preset(receiver).make == nullptr) {
        faults.push_back("receiver = " + receiver + ": needs no node, its topics are only remapped");
      }
    } catch (const std::invalid_argument& error) {
      faults.push_back(std::string("receiver: ") + error.what());
    }
  }
};

}  // namespace urban_gnss
