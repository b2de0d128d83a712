#pragma once

#include "urban_gnss_localization/common/parameters.hpp"
#include "urban_gnss_localization/gnss/learnt_scale.hpp"

namespace urban_gnss {

/// What is believed of a receiver's velocity. Its errors are independent in time (those of a position are not). They
/// are mostly small, and large if a reflected signal is used: Student's t, with a scale that is learnt.
struct VelocityNoiseParameters {
  double velocity_scale_rate{0.03};
  double first_velocity_scale{4.0};
  double velocity_scale_limit{20.0};
  double velocity_dof{1.5};
  double velocity_correlation_time{2.0};

  void visit(ParameterVisitor& v) {
    v("velocity_scale_rate", velocity_scale_rate, between(0.0, 1.0), "",
      "learning rate, per velocity, of the logarithm of the factor on declared covariances; 0: they are right");
    v("first_velocity_scale", first_velocity_scale, positive(), "",
      "initial factor on declared covariances (variances) of velocities, before anything is learnt");
    v("velocity_scale_limit", velocity_scale_limit, at_least(1.0), "",
      "greatest factor by which declared standard deviations of velocities may be too small or too large");
    v("velocity_dof", velocity_dof, positive(), "",
      "degrees of freedom of Student's t noise of a velocity; large: Gaussian");
    v("velocity_correlation_time", velocity_correlation_time, non_negative(), "s",
      "correlation time of the errors of velocities; 0: independent errors");
  }

  /// Where nothing is learnt, receivers are right.
  LearntScale fresh_scale() const {
    return {velocity_scale_rate, velocity_scale_limit, velocity_scale_rate > 0.0 ? first_velocity_scale : 1.0};
  }
};

}  // namespace urban_gnss
