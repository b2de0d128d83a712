#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <vector>

#include "receiver_rig.hpp"
#include "urban_gnss_localization/simulation/position_solution.hpp"

namespace urban_gnss {
namespace {

std::vector<RangeMeasurement> exact_ranges(const Eigen::Vector3d& position,
                                           const std::map<Constellation, double>& clocks,
                                           const std::vector<ReceivedSatellite>& sky) {
  std::vector<RangeMeasurement> measurements;
  for (const ReceivedSatellite& s : sky) {
    measurements.push_back(
        {s.id.constellation, s.line_of_sight, clocks.at(s.id.constellation) - s.line_of_sight.dot(position), 3.0});
  }
  return measurements;
}

const std::map<Constellation, double> kClocks{{Constellation::kGps, 1234.5}, {Constellation::kGalileo, -77.0}};

TEST(PositionSolution, ExactRangesGiveTheExactPosition) {
  const Eigen::Vector3d position(12.0, -7.0, 3.0);
  const auto solution = solve_position(exact_ranges(position, kClocks, open_sky()));
  ASSERT_TRUE(solution);
  EXPECT_TRUE(solution->position.isApprox(position, 1e-9));
  EXPECT_EQ(solution->used_count, 14);
  EXPECT_EQ(solution->clock_count, 2);
  for (const double residual_m : solution->residuals_m) EXPECT_NEAR(residual_m, 0.0, 1e-9);
}

TEST(PositionSolution, DilutionIsTheSpreadOfTheSolutions) {
  // Independent ranges of sigma 1: the spread over many draws is the DOP.
  const auto sky = open_sky();
  RandomEngine engine = make_engine(9);
  double squares = 0.0;
  double hdop = 0.0;
  const int count = 4000;
  for (int i = 0; i < count; ++i) {
    auto ranges = exact_ranges(Eigen::Vector3d::Zero(), kClocks, sky);
    for (RangeMeasurement& range : ranges) range.range_m += draw_normal(engine);
    const auto solution = solve_position(ranges);
    ASSERT_TRUE(solution);
    hdop = solution->hdop;
    squares += solution->position.head<2>().squaredNorm();
  }
  EXPECT_NEAR(std::sqrt(squares / count), hdop, 0.05 * hdop);
}

TEST(PositionSolution, WeightsFavourWhatIsBelieved) {
  auto ranges = exact_ranges(Eigen::Vector3d::Zero(), kClocks, open_sky());
  ranges[0].range_m += 50.0;
  const double equal = solve_position(ranges)->position.norm();
  ranges[0].sigma_m = 30.0;
  EXPECT_LT(solve_position(ranges)->position.norm(), 0.2 * equal);
}

TEST(PositionSolution, LoneConstellationIsLeftOutAndTooFewGiveNothing) {
  auto sky = open_sky();
  sky.resize(5);
  sky[4].id.constellation = Constellation::kGalileo;
  auto ranges = exact_ranges({1.0, 2.0, 3.0}, kClocks, sky);
  const auto solution = solve_position(ranges);
  ASSERT_TRUE(solution);
  EXPECT_EQ(solution->used_count, 4);
  EXPECT_FALSE(solution->used[4]);
  EXPECT_TRUE(std::isnan(solution->residuals_m[4]));
  EXPECT_TRUE(solution->position.isApprox(Eigen::Vector3d(1.0, 2.0, 3.0), 1e-9));
  ranges.erase(ranges.begin());
  EXPECT_FALSE(solve_position(ranges));
  EXPECT_FALSE(solve_position({}));
}

TEST(PositionSolution, SatellitesOnOneConeAreSingular) {
  std::vector<ReceivedSatellite> cone;
  for (int i = 0; i < 8; ++i) cone.push_back(satellite(i + 1, 45.0 * i, 30.0));
  EXPECT_FALSE(solve_position(exact_ranges(Eigen::Vector3d::Zero(), kClocks, cone)));
}

TEST(PositionSolution, PriorHoldsTheHeight) {
  auto ranges = exact_ranges({0.0, 0.0, 20.0}, kClocks, open_sky());
  const double free = solve_position(ranges)->position.z();
  const double held = solve_position(ranges, AltitudePrior{0.0, 0.1})->position.z();
  EXPECT_NEAR(free, 20.0, 1e-9);
  EXPECT_LT(std::abs(held), 1.0);
}

}  // namespace
}  // namespace urban_gnss
