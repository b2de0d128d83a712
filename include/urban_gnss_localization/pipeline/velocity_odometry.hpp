#pragma once

#include <vector>

#include "urban_gnss_localization/gnss/fix.hpp"
#include "urban_gnss_localization/motion/odometry_errors.hpp"
#include "urban_gnss_localization/motion/odometry_history.hpp"

namespace urban_gnss {

/// Odometry of a recording without wheels, out of what the receiver itself says of its motion: a model of constant
/// velocity, for use offline.
///
/// Samples of 10 Hz from the first velocity to the last. Between two velocities the velocity changes evenly; its
/// length is the speed, its direction the course, which stands for the robot's yaw. Below 0.3 m/s, or twice the
/// velocity's own standard deviation, the robot stands: speed 0, and the yaw turns evenly from the course before to the
/// course behind. Between velocities more than 2 s apart there is no sample. A robot that drives backwards or sideways
/// has the yaw of its course, not its own. The stamps must ascend; velocities that do not are left out.
std::vector<OdometrySample> odometry_of_velocities(const std::vector<RawVelocity>& velocities);

/// Velocities of a receiver that reports none: the way between the fixes 3 s before and 3 s behind each, with the
/// standard deviation that two fixes of 3 m give. Reflections that come and go show up in it as motion.
std::vector<RawVelocity> velocities_of_fixes(const std::vector<RawFix>& fixes);

}  // namespace urban_gnss
