#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "urban_gnss_localization/common/parameters.hpp"
#include "urban_gnss_localization/gnss/fix_validation.hpp"
#include "urban_gnss_localization/pipeline/input_clocks.hpp"

namespace urban_gnss {

/// What localizers and the bias filter are told alike: of the robot, its stamps and its receiver.
struct InputParameters {
  std::vector<double> antenna_offset{0.0, 0.0};
  StampParameters stamps;
  FixValidationParameters fix_validation;

  /// m, of the antenna in the base frame.
  Eigen::Vector2d antenna() const { return {antenna_offset[0], antenna_offset[1]}; }

  void visit(ParameterVisitor& v) {
    v.basic()("antenna_offset", antenna_offset, "m", "x and y of the antenna in base_link_frame");
    v.group("stamps", stamps, "Gaps and time jumps in the stamps of the messages.");
    v.group("fix_validation", fix_validation, "Validation of a fix and of its declared covariance.");
  }
  void check(std::vector<std::string>& faults) const {
    if (antenna_offset.size() != 2) faults.push_back("antenna_offset: must be x and y (m)");
  }
};

}  // namespace urban_gnss
