#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <cmath>

namespace urban_gnss {

/// Whether the covariances `a` of one axis and another, and `b` of the other and the one, are the same but for
/// rounding. `scale` is the product of their standard deviations.
inline bool is_same_covariance(double a, double b, double scale) {
  constexpr double kRounding = 1e-6;  // relative
  return std::abs(a - b) <= kRounding * (scale + std::abs(a) + std::abs(b));
}

/// But for rounding. Requires variances that are not negative.
template <int N>
bool is_symmetric(const Eigen::Matrix<double, N, N>& matrix) {
  for (int i = 0; i < N; ++i) {
    for (int j = 0; j < i; ++j) {
      const double scale = std::sqrt(matrix(i, i)) * std::sqrt(matrix(j, j));
      if (!is_same_covariance(matrix(i, j), matrix(j, i), scale)) return false;
    }
  }
  return true;
}

/// Whether a matrix can serve as a covariance: finite, symmetric, with a Cholesky factor. The factor alone does not
/// tell: it is made of the lower triangle.
template <int N>
bool is_positive_definite(const Eigen::Matrix<double, N, N>& matrix) {
  return matrix.allFinite() && Eigen::LLT<Eigen::Matrix<double, N, N>>(matrix).info() == Eigen::Success &&
         is_symmetric<N>(matrix);
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
