#include "urban_gnss_localization/common/covariance_faults.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <cmath>
#include <sstream>

#include "urban_gnss_localization/common/positive_definite.hpp"

namespace urban_gnss {
namespace {

constexpr double kRounding = 1e-6;  ///< relative
constexpr int kMostAxes = 6;

template <class... Parts>
std::string text(const Parts&... parts) {
  std::ostringstream out;
  out.precision(4);
  (out << ... << parts);
  return out.str();
}

}  // namespace

std::string covariance_fault(const Eigen::Ref<const Eigen::MatrixXd>& matrix, std::initializer_list<const char*> axes) {
  const auto name = [&](Eigen::Index i) { return axes.begin()[i]; };
  const Eigen::Index size = matrix.rows();
  for (Eigen::Index i = 0; i < size; ++i) {
    for (Eigen::Index j = 0; j < size; ++j) {
      if (std::isfinite(matrix(i, j))) continue;
      return text("covariance of ", name(i), " and ", name(j), " = ", matrix(i, j), ": must be finite");
    }
    if (matrix(i, i) < 0.0) return text("variance of ", name(i), " = ", matrix(i, i), ": must not be negative");
  }
  using Correlation = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, kMostAxes, kMostAxes>;
  Correlation correlation = Correlation::Identity(size, size);
  for (Eigen::Index i = 0; i < size; ++i) {
    for (Eigen::Index j = 0; j < i; ++j) {
      const double a = matrix(i, j), b = matrix(j, i);
      // Each root by itself: the product of two variances may be beyond what a number holds.
      const double scale = std::sqrt(matrix(i, i)) * std::sqrt(matrix(j, j));
      if (!is_same_covariance(a, b, scale)) {
        return text("covariances of ", name(i), " and ", name(j), " = ", a, " and ", b, ": must be the same");
      }
      if (std::abs(a) > (1.0 + kRounding) * scale) {
        return text("covariance of ", name(i), " and ", name(j), " = ", a, ": their variances are ", matrix(i, i),
                    " and ", matrix(j, j), ", so that it must be within ", scale);
      }
      correlation(i, j) = correlation(j, i) = scale > 0.0 ? a / scale : 0.0;
    }
  }
  if (Eigen::LLT<Correlation>(correlation).info() == Eigen::Success) return {};
  const double least = Eigen::SelfAdjointEigenSolver<Correlation>(correlation).eigenvalues().minCoeff();
  if (least < -kRounding) return text("the covariance is not positive semi-definite (least eigenvalue ", least, ")");
  return {};
}

}  // namespace urban_gnss
