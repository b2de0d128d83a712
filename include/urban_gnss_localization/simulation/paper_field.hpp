#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "urban_gnss_localization/common/parameters.hpp"
#include "urban_gnss_localization/common/random.hpp"
#include "urban_gnss_localization/motion/motion_model.hpp"

namespace urban_gnss {

/// Where the bias points in the shadow. The paper gives its length only, eq. (44).
enum class BiasDirection {
  kRandom,     ///< drawn anew at each entry into the shadow
  kNegativeX,  ///< along -x
};
EnumNames<BiasDirection> enum_names(BiasDirection);

/// The field of Nishida et al., section 4.1.
struct PaperFieldParameters {
  int target_count{8};
  double target_ring_radius{15.0};
  double interval{0.01};
  double shadow_border{0.0};
  double fix_direct_sigma{0.05};
  double fix_shadow_sigma{0.31622776601683794};
  double bias_limit{5.0};
  BiasDirection bias_direction{BiasDirection::kRandom};
  double start_position_sigma{0.05};
  double start_heading_sigma{0.05};
  int seed{1};

  void visit(ParameterVisitor& v) {
    v("target_count", target_count, at_least(2), "", "targets on a ring");
    v("target_ring_radius", target_ring_radius, positive(), "m", "of that ring; the figure with the coordinates is lost");
    v("interval", interval, positive(), "s", "Delta: one motion step and one fix");
    v("shadow_border", shadow_border, any_number(), "m", "the shadow is where x is less");
    v("fix_direct_sigma", fix_direct_sigma, non_negative(), "m", "sigma_b");
    v("fix_shadow_sigma", fix_shadow_sigma, non_negative(), "m", "sigma_s");
    v("bias_limit", bias_limit, non_negative(), "m", "eq. (44)");
    v.basic()("bias_direction", bias_direction, "of the bias in the shadow: random anew at each entry, or along -x");
    v("start_position_sigma", start_position_sigma, non_negative(), "m",
      "of what a localizer is told about the start");
    v("start_heading_sigma", start_heading_sigma, non_negative(), "rad", "likewise");
    v.basic()("seed", seed, any_number(), "", "of all that is random");
  }

  /// x and y of each target in turn, m, counter-clockwise from (target_ring_radius, 0).
  std::vector<double> targets() const;
  /// On the first target, towards the second.
  Pose2 start() const;
};

/// A fix with what the receiver cannot know.
struct SimulatedFix {
  Eigen::Vector2d position{Eigen::Vector2d::Zero()};  ///< m, eq. (9)
  Eigen::Vector2d bias{Eigen::Vector2d::Zero()};      ///< m, eq. (44)
  bool in_shadow{false};
};

/// The simulated robot and receiver. Motion noise, fix noise and bias direction come from streams of their own, so that
/// two methods that steer differently still meet the same noise, draw by draw.
class PaperField {
 public:
  PaperField(const PaperFieldParameters& parameters, const MotionParameters& motion);

  /// Moves the robot by one interval with the noise of eq. (5)-(8).
  void step(const BicycleInput& input);
  /// Eq. (9), (10), (44), (45) at the robot's place. To be called once a step.
  SimulatedFix fix();

  const Pose2& truth() const { return truth_; }
  const PaperFieldParameters& parameters() const { return parameters_; }

 private:
  PaperFieldParameters parameters_;
  MotionParameters motion_;
  RandomEngine motion_engine_;
  RandomEngine fix_engine_;
  RandomEngine direction_engine_;
  Pose2 truth_;
  bool was_in_shadow_{false};
  double direction_rad_{kPi};
};

}  // namespace urban_gnss
