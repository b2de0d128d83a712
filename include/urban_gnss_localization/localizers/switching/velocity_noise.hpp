#pragma once

#include "urban_gnss_localization/common/parameters.hpp"
#include "urban_gnss_localization/localizers/switching/learnt_scale.hpp"

namespace urban_gnss {

/// What is believed of a receiver's velocity. Its errors are independent in time (those of a position are not), small
/// beside most signals, and large where a reflected one is among them: Student's t, with a scale that is learnt.
struct VelocityNoiseParameters {
  double velocity_scale_rate{0.03};   ///< 1, as fix_scale_rate, of the factor on the velocity's covariance
  double first_velocity_scale{4.0};  ///< factor on the velocity's covariance before anything is learnt
  double velocity_scale_limit{20.0};  ///< factor by which its standard deviations may be wrong, either way
  double velocity_dof{2.0};           ///< degrees of freedom of its noise; large ones are Gaussian

  template <class V>
  void visit(V& v) {
    v("velocity_scale_rate", velocity_scale_rate, between(0.0, 1.0));
    v("first_velocity_scale", first_velocity_scale, positive());
    v("velocity_scale_limit", velocity_scale_limit, at_least(1.0));
    v("velocity_dof", velocity_dof, positive());
  }
  void check(std::vector<std::string>&) const {}

  /// Where nothing is learnt, receivers are right.
  LearntScale fresh_scale() const {
    return {velocity_scale_rate, velocity_scale_limit, velocity_scale_rate > 0.0 ? first_velocity_scale : 1.0};
  }
};

}  // namespace urban_gnss
