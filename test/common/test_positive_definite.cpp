#include <gtest/gtest.h>

#include <limits>

#include "urban_gnss_localization/common/positive_definite.hpp"
#include "urban_gnss_localization/common/random.hpp"

namespace urban_gnss {
namespace {

TEST(PositiveDefinite, IsWhatHasACholeskyFactor) {
  Eigen::Matrix2d matrix;
  matrix << 2.0, 1.0, 1.0, 2.0;
  EXPECT_TRUE(is_positive_definite(matrix));
  matrix << 1.0, 2.0, 2.0, 1.0;
  EXPECT_FALSE(is_positive_definite(matrix));
  EXPECT_FALSE(is_positive_definite<2>(Eigen::Matrix2d::Zero()));
  EXPECT_FALSE(is_positive_definite<2>(-Eigen::Matrix2d::Identity()));
  for (const double bad : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    matrix = Eigen::Matrix2d::Identity();
    matrix(0, 0) = bad;
    EXPECT_FALSE(is_positive_definite(matrix));
  }
}

TEST(PositiveDefinite, IsSymmetricButForRounding) {
  Eigen::Matrix2d matrix = Eigen::Matrix2d::Identity();
  matrix(0, 1) = -1e-9;
  EXPECT_TRUE(is_positive_definite(matrix));
  for (const double above : {-1.0, 0.1, 1e300, std::numeric_limits<double>::max()}) {
    matrix(0, 1) = above;
    EXPECT_FALSE(is_positive_definite(matrix)) << above;
  }
  matrix *= 1e-300;
  matrix(0, 1) = 0.5e-300;
  EXPECT_FALSE(is_positive_definite(matrix));
}

TEST(NearestPositiveDefinite, LeavesSoundMatricesAndRepairsOthers) {
  RandomEngine engine = make_engine(9);
  for (int trial = 0; trial < 200; ++trial) {
    Eigen::Matrix<double, 5, 5> a;
    for (Eigen::Index i = 0; i < a.size(); ++i) a.data()[i] = draw_normal(engine);
    const Eigen::Matrix<double, 5, 1> scale = Eigen::Array<double, 5, 1>(1e3, 1.0, 1e-2, 1e-4, 1e2);
    const Eigen::Matrix<double, 5, 5> sound = scale.asDiagonal() * (a * a.transpose()) * scale.asDiagonal();
    EXPECT_TRUE(nearest_positive_definite<5>(sound).isApprox(sound, 1e-6));
    const Eigen::Matrix<double, 5, 5> indefinite = scale.asDiagonal() * (a + a.transpose()) * scale.asDiagonal();
    EXPECT_TRUE(is_positive_definite<5>(nearest_positive_definite<5>(indefinite)));
  }
  EXPECT_TRUE(is_positive_definite<5>(nearest_positive_definite<5>(Eigen::Matrix<double, 5, 5>::Zero())));
}

}  // namespace
}  // namespace urban_gnss
