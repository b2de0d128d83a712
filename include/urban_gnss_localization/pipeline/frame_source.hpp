#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <string>

#include "urban_gnss_localization/common/stamp.hpp"

namespace urban_gnss {

/// How frames lie to each other, as tf tells it. Never waits.
class FrameSource {
 public:
  struct Transform {
    Stamp stamp{0};  ///< 0: it always holds
    Eigen::Isometry3d pose{Eigen::Isometry3d::Identity()};
  };

  virtual ~FrameSource() = default;

  /// The pose of the frame `child` in `parent` (m) at the stamp; nothing where it is not known (yet).
  virtual std::optional<Eigen::Isometry3d> find(const std::string& parent, const std::string& child, Stamp stamp) = 0;
  /// The newest that is known.
  virtual std::optional<Transform> newest(const std::string& parent, const std::string& child) = 0;
  /// Forgets all but what always holds: the clock was set back.
  virtual void forget() = 0;
  /// Why something was not known lately, for people; empty where nothing was missing.
  virtual const std::string& fault() const = 0;
};

}  // namespace urban_gnss
