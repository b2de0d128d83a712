#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/Eigenvalues>

namespace urban_gnss {

/// Whether a symmetric matrix can serve as a covariance: finite, with a Cholesky factor. Reads the lower triangle.
template <int N>
bool is_positive_definite(const Eigen::Matrix<double, N, N>& matrix) {
  return matrix.allFinite() && Eigen::LLT<Eigen::Matrix<double, N, N>>(matrix).info() == Eigen::Success;
}

/// A positive definite matrix close to a symmetric one that rounding, or an indefinite input, left without that: the
/// eigenvalues of its correlation matrix are raised to `floor`. Variances below `floor` become `floor`.
template <int N>
Eigen::Matrix<double, N, N> nearest_positive_definite(const Eigen::Matrix<double, N, N>& matrix, double floor = 1e-12) {
  using Matrix = Eigen::Matrix<double, N, N>;
  const Matrix symmetric = 0.5 * (matrix + matrix.transpose());
  const Eigen::Matrix<double, N, 1> sigma = symmetric.diagonal().cwiseMax(floor).cwiseSqrt();
  Matrix correlation = sigma.cwiseInverse().asDiagonal() * symmetric * sigma.cwiseInverse().asDiagonal();
  correlation = correlation.cwiseMax(-1.0).cwiseMin(1.0);
  correlation.diagonal().setOnes();
  const Eigen::SelfAdjointEigenSolver<Matrix> axes(correlation);
  const Matrix raised =
      axes.eigenvectors() * axes.eigenvalues().cwiseMax(floor).asDiagonal() * axes.eigenvectors().transpose();
  const Matrix scaled = sigma.asDiagonal() * raised * sigma.asDiagonal();
  return 0.5 * (scaled + scaled.transpose());
}

}  // namespace urban_gnss
