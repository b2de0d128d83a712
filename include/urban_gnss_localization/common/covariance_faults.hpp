#pragma once

#include <Eigen/Core>
#include <initializer_list>
#include <string>

namespace urban_gnss {

/// Why a matrix is no covariance, with the numbers: it is not finite, not symmetric, has a variance below 0, a
/// correlation beyond 1, or is not positive semi-definite. Empty where it is one; variances of 0 are, and rounding is
/// allowed for. `axes` names its rows, 6 at most.
std::string covariance_fault(const Eigen::Ref<const Eigen::MatrixXd>& matrix, std::initializer_list<const char*> axes);

}  // namespace urban_gnss
