#pragma once

#include <vector>

#include "urban_gnss_localization/gnss/fix.hpp"
#include "urban_gnss_localization/motion/motion_model.hpp"
#include "urban_gnss_localization/simulation/paper_field.hpp"
#include "urban_gnss_localization/simulation/route.hpp"
#include "urban_gnss_localization/simulation/simulator.hpp"

namespace urban_gnss {

/// The field of Nishida et al. as a simulator: at every step odometry, which reports the command, and a fix.
class PaperFieldSimulator : public Simulator {
 public:
  /// Simulated time before the first step; not 0, which ROS takes for "no time yet".
  static constexpr Stamp kStart{1000000000};
  /// Where the map frame's origin is unless told otherwise: the authors' institute.
  static constexpr GeodeticPosition kDatum{33.8903, 130.8394, 0.0};

  /// Ends after `duration_s`, or never where that is 0. Requires parameters without faults.
  PaperFieldSimulator(const PaperFieldParameters& field, const MotionParameters& motion, double duration_s = 0.0);

  void step(const std::optional<Twist2>& command, std::vector<SimulationEvent>& events) override;

  double interval_s() const override { return field_.parameters().interval; }
  Stamp now() const override { return now_; }
  const Pose2& truth() const override { return field_.truth(); }
  double progress() const override;
  bool is_finished() const override;

  const PaperField& field() const { return field_; }

 private:
  PaperField field_;
  MotionParameters motion_;
  RouteFollower autopilot_;
  double duration_s_;
  long steps_{0};
  Stamp now_{kStart};
  Pose2 odometry_;
};

}  // namespace urban_gnss
