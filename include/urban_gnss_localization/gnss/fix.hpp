#pragma once

#include <Eigen/Core>
#include <string>

#include "urban_gnss_localization/common/stamp.hpp"
#include "urban_gnss_localization/geometry/geodetic_position.hpp"

namespace urban_gnss {

/// How far a receiver says its covariance can be trusted (sensor_msgs/NavSatFix::position_covariance_type).
enum class CovarianceType { kUnknown, kApproximated, kDiagonalKnown, kKnown };

/// A fix as a receiver reports it, nothing checked.
struct RawFix {
  Stamp stamp{0};
  bool has_fix{true};
  GeodeticPosition position;
  Eigen::Matrix3d covariance{Eigen::Matrix3d::Zero()};  ///< ENU, m^2
  CovarianceType covariance_type{CovarianceType::kUnknown};
  bool has_sbas{false};  ///< corrected by SBAS, as the receiver says (sensor_msgs/NavSatStatus::STATUS_SBAS_FIX)
};

/// A receiver's velocity from Doppler shifts, as it reports it, nothing checked.
struct RawVelocity {
  Stamp stamp{0};
  Eigen::Vector2d velocity{Eigen::Vector2d::Zero()};    ///< m/s east and north
  Eigen::Matrix2d covariance{Eigen::Matrix2d::Zero()};  ///< (m/s)^2; not positive definite: not declared
};

/// A fix in the map frame that passed validation: finite, with a positive definite covariance.
struct LocalFix {
  Stamp stamp{0};
  Eigen::Vector2d position{Eigen::Vector2d::Zero()};        ///< east, north of the datum, m
  Eigen::Matrix2d covariance{Eigen::Matrix2d::Identity()};  ///< m^2
};

}  // namespace urban_gnss
