#include <gtest/gtest.h>

#include <cmath>

#include "urban_gnss_localization/gnss/reacquisition.hpp"

namespace urban_gnss {
namespace {

/// Fixes at 1 Hz from `begin_s` to `end_s`.
void add_fixes(Reacquisition& reacquisition, int begin_s, int end_s) {
  for (int t = begin_s; t <= end_s; ++t) reacquisition.add(t);
}

TEST(Reacquisition, AddsNothingWithoutAGap) {
  Reacquisition reacquisition{ReacquisitionParameters()};
  EXPECT_EQ(reacquisition.variance_m2(0.0), 0.0) << "the first fix of all";
  for (int t = 0; t < 1000; t += 30) {
    EXPECT_EQ(reacquisition.variance_m2(t), 0.0) << t;
    reacquisition.add(t);
  }
}

TEST(Reacquisition, FirstFixesAfterAGapAreTheWorst) {
  ReacquisitionParameters p;
  p.reacquisition_gap = 20.0;
  p.reacquisition_sigma = 30.0;
  p.reacquisition_time = 50.0;
  Reacquisition reacquisition(p);
  add_fixes(reacquisition, 0, 100);
  EXPECT_EQ(reacquisition.variance_m2(120.0), 0.0);
  EXPECT_EQ(reacquisition.variance_m2(121.0), 900.0);
  add_fixes(reacquisition, 121, 171);
  EXPECT_NEAR(reacquisition.variance_m2(171.0), 900.0 * std::exp(-2.0), 1e-9);
  add_fixes(reacquisition, 172, 600);
  EXPECT_LT(reacquisition.variance_m2(600.0), 0.01);
  EXPECT_EQ(reacquisition.variance_m2(700.0), 900.0) << "the next gap";
}

TEST(Reacquisition, IsOffWithoutASigma) {
  ReacquisitionParameters p;
  p.reacquisition_sigma = 0.0;
  Reacquisition reacquisition(p);
  add_fixes(reacquisition, 0, 10);
  EXPECT_EQ(reacquisition.variance_m2(500.0), 0.0);
}

}  // namespace
}  // namespace urban_gnss
