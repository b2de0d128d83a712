#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "urban_gnss_localization/common/covariance_faults.hpp"

namespace urban_gnss {
namespace {

using testing::HasSubstr;

std::string fault(const Eigen::Matrix3d& matrix) { return covariance_fault(matrix, {"x", "y", "yaw"}); }

TEST(CovarianceFaults, TakesWhatIsACovariance) {
  Eigen::Matrix3d matrix = Eigen::Vector3d(0.25, 4.0, 1e-9).asDiagonal();
  EXPECT_EQ(fault(matrix), "");
  EXPECT_EQ(fault(Eigen::Matrix3d::Zero()), "") << "0 is a variance";
  EXPECT_EQ(fault(1e300 * Eigen::Matrix3d::Identity()), "") << "whatever its size";
  matrix(0, 1) = matrix(1, 0) = 1.0;  // correlation 1
  EXPECT_EQ(fault(matrix), "");
  matrix(0, 1) *= 1.0 + 1e-12;
  EXPECT_EQ(fault(matrix), "") << "rounding";
  EXPECT_EQ(fault(Eigen::Matrix3d::Ones()), "") << "all the same";
}

TEST(CovarianceFaults, NamesWhatIsWrongWithTheNumbers) {
  const Eigen::Matrix3d good = Eigen::Vector3d(0.25, 4.0, 0.1).asDiagonal();
  Eigen::Matrix3d matrix = good;
  matrix(1, 1) = -1.0;
  EXPECT_EQ(fault(matrix), "variance of y = -1: must not be negative");
  matrix = good;
  matrix(2, 0) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(fault(matrix), "covariance of yaw and x = nan: must be finite");
  matrix = good;
  matrix(0, 1) = matrix(1, 0) = 4.0;
  EXPECT_THAT(fault(matrix), HasSubstr("covariance of y and x = 4: their variances are 4 and 0.25"));
  matrix(1, 0) = 0.5;
  EXPECT_THAT(fault(matrix), HasSubstr("covariances of y and x = 0.5 and 4: must be the same"));
  matrix = good;
  matrix(1, 1) = 0.0;
  matrix(0, 1) = matrix(1, 0) = 1e-3;
  EXPECT_THAT(fault(matrix), HasSubstr("their variances are 0 and 0.25"));
  matrix << 1.0, 0.9, 0.9, 0.9, 1.0, -0.9, 0.9, -0.9, 1.0;  // each pair may be so, the three together not
  EXPECT_THAT(fault(matrix), HasSubstr("not positive semi-definite"));
}

}  // namespace
}  // namespace urban_gnss
