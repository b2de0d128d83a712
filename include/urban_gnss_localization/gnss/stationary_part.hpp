#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "urban_gnss_localization/common/stamp.hpp"
#include "urban_gnss_localization/gnss/fix.hpp"

namespace urban_gnss {

/// A time in which a receiver stands still.
struct StationaryPart {
  Stamp begin{0};
  Stamp end{0};

  double duration_s() const { return to_seconds(end - begin); }
};

/// A position at its time.
struct TimedPosition {
  Stamp stamp{0};
  Eigen::Vector2d position{Eigen::Vector2d::Zero()};  ///< m, east and north of any origin
};

/// The longest part of a recording in which the receiver stands still: its velocities say so (the median of 10 s is
/// below 0.3 m/s), or where it has none, the mean of the fixes of 5 s moves by less than 3 m to that of the next 5 s.
/// And in the whole of it the mean of 5 s stays within 10 m of where it began. Requires both in the order of their
/// stamps; nothing where there are none.
std::optional<StationaryPart> longest_stationary_part(const std::vector<TimedPosition>& fixes,
                                                      const std::vector<RawVelocity>& velocities);

}  // namespace urban_gnss
