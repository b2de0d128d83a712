#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <limits>
#include <set>

#include "matchers.hpp"
#include "urban_gnss_localization/gnss/dilution_of_precision.hpp"
#include "urban_gnss_localization/gnss/satellite.hpp"

namespace urban_gnss {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

Eigen::Vector3d direction(double azimuth_deg, double elevation_deg) {
  return line_of_sight({degrees_to_radians(azimuth_deg), degrees_to_radians(elevation_deg)});
}

std::vector<RangingSatellite> random_satellites(int count, int clocks, RandomEngine& engine) {
  std::vector<RangingSatellite> satellites;
  for (int i = 0; i < count; ++i) {
    const double azimuth = uniform_between(0.0, 360.0, engine);
    const double elevation = uniform_between(5.0, 90.0, engine);
    satellites.push_back({direction(azimuth, elevation), 10 * (i % clocks), uniform_between(0.1, 3.0, engine)});
  }
  return satellites;
}

/// Algorithm 1 as it stands: the inverse of the whole normal matrix.
Eigen::Matrix3d position_block_of_general_inverse(const std::vector<RangingSatellite>& satellites) {
  std::set<int> labels;
  for (const auto& s : satellites) labels.insert(s.clock);
  const auto rows = static_cast<Eigen::Index>(satellites.size());
  Eigen::MatrixXd h = Eigen::MatrixXd::Zero(rows, 3 + static_cast<Eigen::Index>(labels.size()));
  Eigen::VectorXd w(rows);
  for (Eigen::Index i = 0; i < rows; ++i) {
    const RangingSatellite& s = satellites[static_cast<std::size_t>(i)];
    h.row(i).head<3>() = -s.line_of_sight;  // the sign of a linearised range, not the paper's
    h(i, 3 + std::distance(labels.begin(), labels.find(s.clock))) = 1.0;
    w[i] = s.weight;
  }
  return (h.transpose() * w.asDiagonal() * h).inverse().topLeftCorner<3, 3>();
}

TEST(DilutionOfPrecision, AgreesWithTheInverseOfTheWholeNormalMatrix) {
  RandomEngine engine = make_engine(1);
  int compared = 0;
  for (int trial = 0; trial < 2000; ++trial) {
    const int clocks = 1 + trial % 4;
    const auto satellites = random_satellites(3 + clocks + trial % 20, clocks, engine);
    const Eigen::Matrix3d expected = position_block_of_general_inverse(satellites);
    if (expected.trace() > 1e4) continue;  // there the reference itself has lost its digits
    const auto dop = dilution_of_precision(satellites);
    ASSERT_TRUE(dop);
    ASSERT_TRUE(dop->position.isApprox(expected, 1e-9)) << dop->position << "\n\n" << expected;
    ++compared;
  }
  EXPECT_GT(compared, 1500);
}

TEST(DilutionOfPrecision, OneAtTheZenithThreeAtTheHorizon) {
  // In closed form: 2/3 in each horizontal axis; the vertical from 1 - m at the zenith and -m at the horizon, 4/3.
  const auto dop = dilution_of_precision(
      std::vector<Eigen::Vector3d>{direction(0, 90), direction(0, 0), direction(120, 0), direction(240, 0)});
  ASSERT_TRUE(dop);
  const Eigen::Vector3d expected(2.0 / 3.0, 2.0 / 3.0, 4.0 / 3.0);
  EXPECT_TRUE(dop->position.isApprox(Eigen::Matrix3d(expected.asDiagonal()), 1e-12)) << dop->position;
  EXPECT_NEAR(dop->hdop(), 1.1547, 1e-4);
  EXPECT_NEAR(dop->vdop(), 1.1547, 1e-4);
  EXPECT_NEAR(dop->pdop(), 1.6330, 1e-4);
}

TEST(DilutionOfPrecision, HorizontalCovarianceIsScaledByTheRangeVariance) {
  const auto dop = dilution_of_precision(
      std::vector<Eigen::Vector3d>{direction(0, 90), direction(0, 0), direction(90, 0), direction(200, 10)});
  ASSERT_TRUE(dop);
  const Eigen::Matrix2d covariance = horizontal_covariance(*dop, 3.75);
  EXPECT_TRUE(covariance.isApprox(dop->position.topLeftCorner<2, 2>() * 14.0625, 1e-12));
  EXPECT_NE(covariance(0, 1), 0.0);
  EXPECT_NEAR(std::sqrt(covariance.trace()), 3.75 * dop->hdop(), 1e-12);
}

TEST(DilutionOfPrecision, OrderDoesNotMatter) {
  RandomEngine engine = make_engine(2);
  for (int trial = 0; trial < 100; ++trial) {
    auto satellites = random_satellites(12, 3, engine);
    const auto before = dilution_of_precision(satellites);
    for (std::size_t i = satellites.size() - 1; i > 0; --i) std::swap(satellites[i], satellites[engine() % (i + 1)]);
    const auto after = dilution_of_precision(satellites);
    ASSERT_TRUE(before && after);
    ASSERT_TRUE(after->position.isApprox(before->position, 1e-10));
  }
}

TEST(DilutionOfPrecision, TurnsWithTheSky) {
  RandomEngine engine = make_engine(3);
  for (int trial = 0; trial < 100; ++trial) {
    auto satellites = random_satellites(9, 2, engine);
    const auto before = dilution_of_precision(satellites);
    const Eigen::Matrix3d turn =
        Eigen::AngleAxisd(uniform_between(-kPi, kPi, engine), Eigen::Vector3d::UnitZ()).toRotationMatrix();
    for (auto& s : satellites) s.line_of_sight = turn * s.line_of_sight;
    const auto after = dilution_of_precision(satellites);
    ASSERT_TRUE(before && after);
    ASSERT_TRUE(after->position.isApprox(turn * before->position * turn.transpose(), 1e-9));
    ASSERT_NEAR(after->hdop(), before->hdop(), 1e-9 * before->hdop());
    ASSERT_NEAR(after->vdop(), before->vdop(), 1e-9 * before->vdop());
  }
}

TEST(DilutionOfPrecision, RemovingASatelliteNeverLowersIt) {
  RandomEngine engine = make_engine(4);
  for (int trial = 0; trial < 300; ++trial) {
    auto satellites = random_satellites(10, 2, engine);
    auto before = dilution_of_precision(satellites);
    while (before) {
      satellites.erase(satellites.begin() + static_cast<std::ptrdiff_t>(engine() % satellites.size()));
      const auto after = dilution_of_precision(satellites);
      if (after) {
        ASSERT_GE(after->hdop(), before->hdop() * (1.0 - 1e-9));
        ASSERT_GE(after->vdop(), before->vdop() * (1.0 - 1e-9));
        ASSERT_GE(after->pdop(), before->pdop() * (1.0 - 1e-9));
      }
      before = after;
    }
    ASSERT_LE(satellites.size(), 4u);
  }
}

TEST(DilutionOfPrecision, ClockOfItsOwnMakesASatelliteUseless) {
  RandomEngine engine = make_engine(5);
  auto satellites = random_satellites(8, 1, engine);
  const auto before = dilution_of_precision(satellites);
  satellites.push_back({direction(77, 33), 6, 1.0});
  const auto after = dilution_of_precision(satellites);
  ASSERT_TRUE(before && after);
  EXPECT_TRUE(after->position.isApprox(before->position, 1e-12));

  satellites.back().clock = satellites.front().clock;
  EXPECT_LT(dilution_of_precision(satellites)->pdop(), before->pdop());
}

TEST(DilutionOfPrecision, WeightOneIsUnweighted) {
  RandomEngine engine = make_engine(6);
  auto satellites = random_satellites(9, 1, engine);
  std::vector<Eigen::Vector3d> directions;
  for (auto& s : satellites) {
    s.weight = 1.0;
    directions.push_back(s.line_of_sight);
  }
  EXPECT_EQ(dilution_of_precision(satellites)->position, dilution_of_precision(directions)->position);
  for (auto& s : satellites) s.weight = 4.0;
  EXPECT_NEAR(dilution_of_precision(satellites)->pdop(), dilution_of_precision(directions)->pdop() / 2.0, 1e-12);
}

TEST(DilutionOfPrecision, WeightTwoIsTwoSatellites) {
  RandomEngine engine = make_engine(7);
  auto satellites = random_satellites(7, 2, engine);
  auto doubled = satellites;
  doubled.push_back(doubled[3]);
  satellites[3].weight *= 2.0;
  EXPECT_TRUE(dilution_of_precision(satellites)->position.isApprox(dilution_of_precision(doubled)->position, 1e-10));
}

TEST(DilutionOfPrecision, TooFewSatellites) {
  RandomEngine engine = make_engine(8);
  EXPECT_FALSE(dilution_of_precision(std::vector<RangingSatellite>{}));
  for (int clocks = 1; clocks <= 4; ++clocks) {
    for (int count = 1; count < 3 + clocks; ++count) {
      // The labels are dealt in turn, so that fewer satellites than clocks have fewer clocks.
      if (count < clocks) continue;
      EXPECT_FALSE(dilution_of_precision(random_satellites(count, clocks, engine))) << count << ", " << clocks;
    }
    EXPECT_TRUE(dilution_of_precision(random_satellites(3 + clocks, clocks, engine))) << clocks;
  }
}

TEST(DilutionOfPrecision, SingularGeometry) {
  std::vector<Eigen::Vector3d> cone;
  for (int i = 0; i < 9; ++i) cone.push_back(direction(40.0 * i, 35.0));
  EXPECT_FALSE(dilution_of_precision(cone)) << "height and clock cannot be told apart";

  const Eigen::Matrix3d tilt = Eigen::AngleAxisd(0.4, Eigen::Vector3d(1.0, 2.0, 0.3).normalized()).toRotationMatrix();
  for (auto& d : cone) d = tilt * d;
  EXPECT_FALSE(dilution_of_precision(cone)) << "nor along the axis of a tilted cone";

  EXPECT_FALSE(dilution_of_precision(std::vector<Eigen::Vector3d>(12, direction(30.0, 50.0)))) << "one direction";
  EXPECT_FALSE(dilution_of_precision(std::vector<Eigen::Vector3d>{direction(0, 90), direction(0, 0), direction(120, 0),
                                                                  direction(120, 0), direction(0, 0)}))
      << "three directions";
  std::vector<Eigen::Vector3d> arc;
  for (const double elevation : {10.0, 40.0, 60.0, 80.0}) arc.push_back(direction(20.0, elevation));
  EXPECT_FALSE(dilution_of_precision(arc)) << "all in one vertical plane";
}

TEST(DilutionOfPrecision, NearlySingularIsLargeAndThenEmpty) {
  const auto cone_with_one_off = [](double lift_deg) {
    std::vector<Eigen::Vector3d> cone{direction(0, 35.0 + lift_deg)};
    for (int i = 1; i < 6; ++i) cone.push_back(direction(60.0 * i, 35.0));
    return dilution_of_precision(cone);
  };
  const auto narrow = cone_with_one_off(0.1);
  ASSERT_TRUE(narrow);
  EXPECT_GT(narrow->vdop(), 500.0);
  EXPECT_TRUE(narrow->position.allFinite());
  EXPECT_FALSE(cone_with_one_off(1e-4));
}

TEST(DilutionOfPrecision, UnusableSatellitesAreLeftOut) {
  RandomEngine engine = make_engine(9);
  auto satellites = random_satellites(7, 1, engine);
  const auto expected = dilution_of_precision(satellites);
  for (const double weight : {0.0, -1.0, kNaN, kInfinity}) satellites.push_back({direction(10, 20), 99, weight});
  satellites.push_back({Eigen::Vector3d(kNaN, 0.0, 1.0), 0, 1.0});
  satellites.push_back({Eigen::Vector3d(kInfinity, 0.0, 1.0), 0, 1.0});
  const auto dop = dilution_of_precision(satellites);
  ASSERT_TRUE(expected && dop);
  EXPECT_EQ(dop->position, expected->position);

  for (auto& s : satellites) s.weight = std::numeric_limits<double>::max();
  EXPECT_FALSE(dilution_of_precision(satellites)) << "the sum of the weights overflows";
}

}  // namespace
}  // namespace urban_gnss
