#pragma once

#include <Eigen/Core>

#include "urban_gnss_localization/common/parameters.hpp"
#include "urban_gnss_localization/localizers/particle_set.hpp"

namespace urban_gnss {

/// How the terms of eq. (27) and (31) are put together.
enum class LikelihoodForm {
  kPrinted,  ///< sums of one-dimensional exponentials with two-dimensional normalisers, as in the text
  kSum,      ///< the same sums, each term normalised in its one dimension
  kProduct,  ///< a bivariate Gaussian, and a ring that integrates to 1 where r-hat > 2 sigma_s; the heading multiplies
};
EnumNames<LikelihoodForm> enum_names(LikelihoodForm);

/// One fix as the likelihood of a particle sees it.
struct FixLikelihood {
  LikelihoodForm form{LikelihoodForm::kProduct};
  bool with_shadow{true};                                          ///< eq. (33); false is eq. (47)
  bool with_heading{false};                                        ///< the terms in d_theta
  Eigen::Vector2d fix{Eigen::Vector2d::Zero()};                    ///< m, map frame
  Eigen::Vector2d antenna_in_body{Eigen::Vector2d::Zero()};        ///< m, antenna at the fix's stamp, from the base now
  Eigen::Matrix2d direct_covariance{Eigen::Matrix2d::Identity()};  ///< m^2, Sigma_b
  double shadow_sigma{1.0};                                        ///< m, sigma_s
  double heading_sigma{0.1};                                       ///< rad, sigma_p
  double radius{0.0};                                              ///< m, r-hat
  double fix_heading{0.0};                                         ///< rad, theta_GPS of eq. (12)
};

/// Log of eq. (33) (or (47)) for one pose.
double log_likelihood(const Pose2& pose, const FixLikelihood& fix);

/// Eq. (34) without the normalisation: adds the log-likelihood to every particle's log-weight. No allocation.
void weigh(ParticleSet& particles, const FixLikelihood& fix);

/// Eq. (12): heading from the last estimated position to the fix, plus the turn since.
double fix_heading(const Eigen::Vector2d& fix, const Eigen::Vector2d& last_position, double turn_since_rad);

}  // namespace urban_gnss
