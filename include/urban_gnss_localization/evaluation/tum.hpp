#pragma once

#include <iosfwd>

#include "urban_gnss_localization/evaluation/trajectory.hpp"

namespace urban_gnss {

/// Writes one line `stamp x y z qx qy qz qw` a pose, as the TUM RGB-D benchmark defined it and evo reads it: seconds,
/// metres and a unit quaternion, all with nine decimals; z = 0. The covariance is not written. Throws
/// std::invalid_argument where a pose is not finite.
void write_tum(std::ostream& out, const Trajectory& trajectory);

/// Reads what write_tum writes, and what others write in that format: z, roll and pitch are left out, empty lines and
/// lines that begin with # are skipped, stamps are put in order. Throws std::runtime_error with the line's number
/// where a line does not hold eight finite numbers or its quaternion is zero.
Trajectory read_tum(std::istream& in);

}  // namespace urban_gnss
