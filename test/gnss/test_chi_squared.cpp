#include <gtest/gtest.h>

#include <limits>
#include <stdexcept>
#include <string>

#include "urban_gnss_localization/gnss/chi_squared.hpp"

namespace urban_gnss {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

// Any printed table, e.g. Abramowitz and Stegun, table 26.8.
TEST(ChiSquared, QuantilesAreThoseOfTheTable) {
  EXPECT_NEAR(chi_squared_quantile(0.95, 1), 3.84146, 5e-6);
  EXPECT_NEAR(chi_squared_quantile(0.95, 2), 5.99146, 5e-6);
  EXPECT_NEAR(chi_squared_quantile(0.95, 3), 7.81473, 5e-6);
  EXPECT_NEAR(chi_squared_quantile(0.99, 2), 9.21034, 5e-6);
  EXPECT_NEAR(chi_squared_quantile(0.999, 30), 59.7031, 5e-5);
}

TEST(ChiSquared, QuantileAtZeroIsZero) { EXPECT_EQ(chi_squared_quantile(0.0, 2), 0.0); }

TEST(ChiSquared, CdfInvertsTheQuantile) {
  for (const int dof : {1, 2, 3, 10, 1000}) {
    for (const double probability : {0.001, 0.5, 0.95, 0.9999}) {
      EXPECT_NEAR(chi_squared_cdf(chi_squared_quantile(probability, dof), dof), probability, 1e-12);
    }
  }
}

TEST(ChiSquared, CdfIsDefinedOnTheWholeLine) {
  EXPECT_EQ(chi_squared_cdf(-kInfinity, 2), 0.0);
  EXPECT_EQ(chi_squared_cdf(-1.0, 2), 0.0);
  EXPECT_EQ(chi_squared_cdf(0.0, 1), 0.0);
  EXPECT_EQ(chi_squared_cdf(kInfinity, 2), 1.0);
}

TEST(ChiSquared, RefusesWhatHasNoAnswerAndNamesIt) {
  for (const double probability : {-0.1, 1.0, 1.5, kNaN, kInfinity}) {
    try {
      chi_squared_quantile(probability, 2);
      ADD_FAILURE() << "accepted a probability of " << probability;
    } catch (const std::invalid_argument& error) {
      EXPECT_NE(std::string(error.what()).find("probability"), std::string::npos) << error.what();
    }
  }
  for (const int dof : {0, -1}) {
    try {
      chi_squared_quantile(0.95, dof);
      ADD_FAILURE() << "accepted a dof of " << dof;
    } catch (const std::invalid_argument& error) {
      EXPECT_NE(std::string(error.what()).find("dof"), std::string::npos) << error.what();
    }
  }
  EXPECT_THROW(chi_squared_cdf(kNaN, 2), std::invalid_argument);
  EXPECT_THROW(chi_squared_cdf(1.0, 0), std::invalid_argument);
}

}  // namespace
}  // namespace urban_gnss
