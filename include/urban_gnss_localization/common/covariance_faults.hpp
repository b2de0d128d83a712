#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

namespace urban_gnss {

/// Why a matrix is no covariance, with the numbers: it is not finite, not symmetric, has a variance below 0, a
/// correlation beyond 1, or is not positive semi-definite. Empty where it is one; variances of 0 are, and rounding is
/// allowed for. `axes` names its rows.
std::string covariance_fault(const Eigen::MatrixXd& matrix, const std::vector<const char*>& axes);

}  // namespace urban_gnss
