#pragma once

#include <cmath>
#include <functional>
#include <utility>
#include <vector>

#include "urban_gnss_localization/common/random.hpp"
#include "urban_gnss_localization/motion/odometry_history.hpp"

namespace urban_gnss {

/// A robot that stands for 3 s and then drives a winding road at 2 m/s, from (20, -10, 2.0) of the map, and what its
/// odometry says of it: a pose from (0, 0, 0) and a twist, both a little wrong.
struct OdometryDrive {
  double rate_hz{20.0};
  double duration_s{120.0};
  std::function<Twist2(double time_s)> motion{[](double time_s) {
    if (time_s < 3.0) return Twist2{};
    return Twist2{2.0, 0.06 + 0.25 * std::sin(time_s / 6.0)};
  }};
  std::uint64_t seed{1};

  struct Moment {
    double time_s;
    Pose2 truth;
    OdometrySample told;
  };

  static Stamp at(double time_s) { return from_seconds(1000.0 + time_s); }

  std::vector<Moment> moments() const {
    constexpr double kStep_s = 0.001;
    RandomEngine engine = make_engine(seed);
    std::vector<Moment> all;
    const Pose2 start{20.0, -10.0, 2.0};
    Pose2 truth = start;
    const long every = std::lround(1.0 / (rate_hz * kStep_s));
    const long last = std::lround(duration_s / kStep_s);
    for (long k = 0; k <= last; ++k) {
      const double time_s = kStep_s * static_cast<double>(k);
      const Twist2 twist = motion(time_s);
      if (k > 0) truth = move(truth, twist, kStep_s);
      if (k % every != 0) continue;
      Moment moment{time_s, truth, {at(time_s), relative_pose(start, truth), twist}};
      const bool moves = twist.ground_speed_mps() > 0.0 || twist.yaw_rate_radps != 0.0;
      if (moves) {
        moment.told.twist.speed_mps = 1.01 * twist.speed_mps + 0.01 * draw_normal(engine);
        moment.told.twist.yaw_rate_radps += 0.01 * draw_normal(engine);
      }
      all.push_back(moment);
    }
    return all;
  }
};

}  // namespace urban_gnss
