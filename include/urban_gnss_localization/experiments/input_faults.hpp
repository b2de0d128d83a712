#pragma once

#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "urban_gnss_localization/motion/motion_model.hpp"
#include "urban_gnss_localization/simulation/scenario.hpp"

namespace urban_gnss {

/// When a fault begins.
enum class FaultBegin {
  kOnset,  ///< at a given time
  kTurn,   ///< in the first sharp turn from then on
  kStart,  ///< with the drive
};

/// Something that is wrong with what a localizer is told. The defaults change nothing.
struct InputFault {
  std::string name;
  FaultBegin begin{FaultBegin::kOnset};
  double duration_s{std::numeric_limits<double>::infinity()};  ///< infinite: to the end of the drive
  std::function<Twist2(const Twist2&)> wheels{};               ///< the odometry's wrong twist; empty: it is right
  double gyro_offset_radps{0.0};                               ///< the IMU's yaw rate is too large by this
  double fix_delay_s{0.0};       ///< the receiver's epochs come too late, and have the stamp at which they come
  double pose_offset_m{0.0};     ///< to the left: a pose that is wrong by this is set when the fault begins
  double antenna_offset_m{0.0};  ///< forward: the antenna's place is wrong by this from when the fault begins
};

/// What a differential drive says whose left encoder is dead. `track_width_m` > 0.
Twist2 without_left_wheel(const Twist2& twist, double track_width_m);

/// The faults of the glitch table. The first is none.
std::vector<InputFault> input_faults(const Scenario& scenario);

}  // namespace urban_gnss
