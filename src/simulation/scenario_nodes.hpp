#pragma once

#include <yaml-cpp/yaml.h>

#include <Eigen/Core>
#include <cmath>
#include <optional>
#include <vector>

namespace urban_gnss {

/// [x, y], both finite.
inline std::optional<Eigen::Vector2d> point_of(const YAML::Node& node) {
  try {
    const auto values = node.as<std::vector<double>>();
    if (values.size() != 2 || !std::isfinite(values[0]) || !std::isfinite(values[1])) return std::nullopt;
    return Eigen::Vector2d(values[0], values[1]);
  } catch (const YAML::Exception&) {
    return std::nullopt;
  }
}

}  // namespace urban_gnss
