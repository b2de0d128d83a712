#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <cmath>

namespace urban_gnss {

/// Spread and weights of the scaled unscented transform (Julier 2002; Wan and van der Merwe 2000) of N dimensions. The
/// points are the mean (point 0) and the mean plus and minus `spread` times each column of a root of the covariance.
struct UnscentedWeights {
  double spread{1.0};             ///< sqrt(N + lambda) = alpha sqrt(N + kappa)
  double centre_covariance{0.0};  ///< weight of point 0 in the covariance
  double other{0.0};              ///< weight of each other point, in mean and covariance

  /// Requires alpha > 0 and N + kappa > 0. The weight of point 0 in the mean is 1 - 2 N other: it is not needed where
  /// means are taken of differences from point 0.
  static UnscentedWeights of(int dimension, double alpha, double beta, double kappa) {
    const double n = dimension;
    const double spread_squared = alpha * alpha * (n + kappa);
    UnscentedWeights weights;
    weights.spread = std::sqrt(spread_squared);
    weights.other = 0.5 / spread_squared;
    weights.centre_covariance = 1.0 - n / spread_squared + 1.0 - alpha * alpha + beta;
    return weights;
  }
};

/// The lower Cholesky factor L, L L^T = covariance. Requires a positive definite matrix.
template <int N>
Eigen::Matrix<double, N, N> cholesky_root(const Eigen::Matrix<double, N, N>& covariance) {
  return Eigen::LLT<Eigen::Matrix<double, N, N>>(covariance).matrixL();
}

}  // namespace urban_gnss
