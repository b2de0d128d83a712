#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <limits>
#include <map>
#include <sstream>

#include "satellite_sky.hpp"

namespace urban_gnss {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

TEST(SoftGnssCovariance, SoftWithoutReflectionsAndEqualWeightsIsEquation4) {
  auto p = with_model(CovarianceModel::kSoft);
  p.receiver_weighting = ReceiverWeighting::kEqual;
  EXPECT_TRUE(compute(open_sky(), p).weighted.isApprox(equation_4(open_sky(), 3.75), 1e-9)) << "nothing is known";
  // Blocked nowhere and strong: 1e-6 of a chance each.
  const auto result = compute(open_sky(60.0, 0.0), p);
  EXPECT_TRUE(result.weighted.isApprox(equation_4(open_sky(), 3.75), 1e-2));
  EXPECT_EQ(result.source, VisibilitySource::kLidarAndSatellites);
}

/// The header's derivation, checked by drawing errors of ranges and solving for the fix.
void expect_second_moment_of_simulated_fixes(const GnssCovarianceParameters& p, int not_received) {
  RandomEngine engine = make_engine(1);
  Sky sky = open_sky();
  for (auto& s : sky) {
    s.cn0_dbhz = uniform_between(20, 45, engine);
    s.blocked_fraction = draw_uniform(engine);
    s.known_fraction = 1.0;
  }
  Sky in_view = sky;
  for (int i = 0; i < not_received; ++i) {
    in_view.push_back(satellite(20 + i, 40.0 * i, 30.0));
    in_view.back().tracked = false;
  }
  const auto result = compute(in_view, p);

  const auto count = static_cast<Eigen::Index>(sky.size());
  double hidden = not_received;
  for (std::size_t i = 0; i < sky.size(); ++i) hidden += result.satellites[i].nlos_probability;
  const double hidden_share = hidden / static_cast<double>(in_view.size());
  std::vector<double> scale;
  for (const auto& s : sky) {
    scale.push_back(std::pow(hidden_share, p.nlos_hidden_exponent) *
                    std::pow(0.75 / std::tan(s.look.elevation_rad), p.nlos.elevation_exponent));
  }
  Eigen::MatrixXd h(count, 4);
  Eigen::VectorXd weight(count);
  for (Eigen::Index i = 0; i < count; ++i) {
    const auto& s = sky[static_cast<std::size_t>(i)];
    h.row(i) << line_of_sight(s.look).transpose(), 1.0;
    weight[i] = std::clamp(std::pow(10.0, (s.cn0_dbhz - 40.0) / 10.0), 0.01, 1.0);
  }
  const Eigen::MatrixXd gain =
      (h.transpose() * weight.asDiagonal() * h).inverse() * h.transpose() * weight.asDiagonal();
  constexpr int kDraws = 200000;
  Eigen::Matrix2d moment = Eigen::Matrix2d::Zero();
  for (int draw = 0; draw < kDraws; ++draw) {
    Eigen::VectorXd error(count);
    for (Eigen::Index i = 0; i < count; ++i) {
      const auto k = static_cast<std::size_t>(i);
      const bool is_reflected = draw_uniform(engine) < result.satellites[k].nlos_probability;
      const double sigma = is_reflected ? std::max(scale[k] * p.nlos.sigma, p.sigma_ure) : p.sigma_ure;
      error[i] = (is_reflected ? scale[k] * p.nlos.mean : 0.0) + sigma * draw_normal(engine);
    }
    const Eigen::Vector2d fix = (gain * error).head<2>();
    moment += fix * fix.transpose() / kDraws;
  }
  // Errors of 200 000 fourth moments: below 1 % (kurtosis under 10).
  EXPECT_TRUE(result.model.isApprox(moment, 0.03)) << result.model << "\n\n" << moment;
  EXPECT_GT(result.model.trace(), 4.0 * equation_4(sky, 3.75).trace());
}

TEST(SoftGnssCovariance, SoftIsTheSecondMomentOfSimulatedFixes) {
  GnssCovarianceParameters p;
  expect_second_moment_of_simulated_fixes(p, 0);
  p.nlos_hidden_exponent = 0.7;
  p.nlos.elevation_exponent = 1.2;
  p.nlos.mean = 40.0;
  expect_second_moment_of_simulated_fixes(p, 0);
  expect_second_moment_of_simulated_fixes(p, 7);
}

TEST(SoftGnssCovariance, ReflectionsGrowWithTheHiddenShareIfToldSo) {
  const auto sigma_with = [](int not_received, double exponent) {
    GnssCovarianceParameters p;
    p.nlos_hidden_exponent = exponent;
    Sky sky = open_sky(42.0, 0.0);
    sky[0].cn0_dbhz = 20.0;
    sky[0].blocked_fraction = 1.0;
    for (int i = 0; i < not_received; ++i) {
      sky.push_back(satellite(20 + i, 30.0 * i, 45.0));
      sky.back().tracked = false;
    }
    sky.push_back(satellite(40, 0.0, -5.0));  // not in view
    sky.back().tracked = false;
    return position_sigma(compute(sky, p).weighted);
  };
  for (int not_received = 1; not_received <= 12; ++not_received) {
    EXPECT_GT(sigma_with(not_received, 1.0), sigma_with(not_received - 1, 1.0)) << not_received;
    EXPECT_EQ(sigma_with(not_received, 0.0), sigma_with(0, 0.0)) << not_received;
    EXPECT_LT(sigma_with(not_received, 1.0), sigma_with(not_received, 0.0)) << "as all were hidden";
  }
}

TEST(SoftGnssCovariance, ReflectionsGrowTowardsTheHorizonIfToldSo) {
  const auto growth = [](double elevation_deg) {  // of the error by one reflection, against an exponent of 0
    const auto sigma_with = [&](double exponent) {
      GnssCovarianceParameters p;
      p.sigma_ure = 0.01;  // nothing but the reflection counts
      p.nlos.elevation_exponent = exponent;
      p.receiver_weighting = ReceiverWeighting::kEqual;
      Sky sky = open_sky(60.0, 0.0);
      sky[0].look.elevation_rad = degrees_to_radians(elevation_deg);
      sky[0].cn0_dbhz = 10.0;
      sky[0].blocked_fraction = 1.0;
      return position_sigma(compute(sky, p).weighted);
    };
    return sigma_with(1.5) / sigma_with(0.0);
  };
  for (double elevation_deg = 15.0; elevation_deg <= 70.0; elevation_deg += 5.0) {
    const double expected = std::pow(0.75 / std::tan(degrees_to_radians(elevation_deg)), 1.5);
    EXPECT_NEAR(growth(elevation_deg), expected, 0.02 * expected) << elevation_deg;
  }
  EXPECT_NEAR(growth(5.0), growth(15.0), 0.02) << "limited by the walls' length";
  EXPECT_TRUE(std::isfinite(growth(90.0)));
}

TEST(SoftGnssCovariance, OpenSkyHasNoReflectionsToGrow) {
  GnssCovarianceParameters p;
  const auto base = compute(open_sky(60.0, 0.0), p);
  p.nlos_hidden_exponent = 2.0;
  p.nlos.elevation_exponent = 2.0;
  EXPECT_TRUE(compute(open_sky(60.0, 0.0), p).weighted.isApprox(base.weighted, 1e-2));
}

TEST(SoftGnssCovariance, DelayOfAllRangesGoesIntoTheClock) {
  GnssCovarianceParameters p;
  p.nlos_if_blocked = 0.999;
  p.nlos.sigma = p.sigma_ure;
  const auto result = compute(open_sky(kNaN, 1.0), p);
  EXPECT_TRUE(result.model.isApprox(equation_4(open_sky(), 3.75), 0.1)) << "not 25 m of error";
}

TEST(SoftGnssCovariance, SoftGrowsSmoothlyWithEachBlockedFraction) {
  for (std::size_t i = 0; i < open_sky().size(); ++i) {
    double last = 0.0;
    for (int step = 0; step <= 100; ++step) {
      Sky sky = open_sky(42.0, 0.0);
      sky[i].blocked_fraction = 0.01 * step;
      const double sigma = position_sigma(compute(sky, {}).weighted);
      EXPECT_GE(sigma, last) << "satellite " << i << ", step " << step;
      EXPECT_LT(sigma, (step == 0 ? kInfinity : last + 0.5)) << "satellite " << i << ", step " << step;
      last = sigma;
    }
  }
}

TEST(SoftGnssCovariance, PaperJumpsWhereSoftDoesNot) {
  const auto sigma_with = [](int blocked, CovarianceModel model) {
    Sky sky = open_sky(kNaN, 0.0);
    for (int i = 0; i < blocked; ++i) sky[static_cast<std::size_t>(i)].blocked_fraction = 1.0;
    return position_sigma(compute(sky, with_model(model)).weighted);
  };
  EXPECT_GT(sigma_with(6, CovarianceModel::kPaper), 800.0);
  EXPECT_LT(sigma_with(5, CovarianceModel::kPaper), 100.0);
  for (int blocked = 0; blocked <= 9; ++blocked) EXPECT_LT(sigma_with(blocked, CovarianceModel::kSoft), 60.0);
  EXPECT_GT(sigma_with(5, CovarianceModel::kSoft), 2.0 * sigma_with(0, CovarianceModel::kSoft));
}

TEST(SoftGnssCovariance, ProbabilityFollowsSignalAndElevation) {
  const auto probability = [](double cn0, double elevation_deg, double blocked, double known) {
    Sky sky = open_sky(42.0);
    sky[0].cn0_dbhz = cn0;
    sky[0].look.elevation_rad = degrees_to_radians(elevation_deg);
    sky[0].blocked_fraction = blocked;
    sky[0].known_fraction = known;
    return compute(sky, {}).satellites[0].nlos_probability;
  };
  EXPECT_NEAR(probability(28.0, radians_to_degrees(std::asin(0.6)), kNaN, 0.0), 0.5, 1e-9);
  EXPECT_GT(probability(22.0, 40.0, kNaN, 0.0), 0.8);
  EXPECT_LT(probability(36.0, 40.0, kNaN, 0.0), 0.1);
  EXPECT_LT(probability(45.0, 40.0, kNaN, 0.0), 0.01);
  EXPECT_GT(probability(30.0, 10.0, kNaN, 0.0), probability(30.0, 80.0, kNaN, 0.0));
  EXPECT_GT(probability(36.0, 40.0, 1.0, 1.0), 0.7) << "a strong signal through a wall of the map";
  EXPECT_LT(probability(30.0, 40.0, 0.0, 1.0), 0.5 * probability(30.0, 40.0, kNaN, 0.0));
  EXPECT_EQ(probability(30.0, 40.0, 0.0, 0.0), probability(30.0, 40.0, kNaN, 0.0)) << "unknown is not free";
  EXPECT_NEAR(probability(kNaN, 40.0, 1.0, 1.0), 0.9, 1e-12);
  EXPECT_NEAR(probability(kNaN, 40.0, 0.0, 1.0), 0.005, 1e-12);
  EXPECT_NEAR(probability(kNaN, 40.0, 0.25, 0.5), 0.25 * 0.9 + 0.25 * 0.005 + 0.5 * 0.1, 1e-12);
  EXPECT_EQ(probability(0.0, 40.0, 1.0, 1.0), probability(kNaN, 40.0, 1.0, 1.0)) << "0 is unknown";
}

TEST(SoftGnssCovariance, SaysWhatItUsed) {
  const auto soft = with_model(CovarianceModel::kSoft);
  EXPECT_EQ(compute(open_sky(), soft).source, VisibilitySource::kNone);
  EXPECT_EQ(compute(open_sky(40.0), soft).source, VisibilitySource::kSatellites);
  EXPECT_EQ(compute(open_sky(kNaN, 0.1), soft).source, VisibilitySource::kLidar);
  EXPECT_EQ(compute(open_sky(40.0, 0.1), soft).source, VisibilitySource::kLidarAndSatellites);
  EXPECT_EQ(compute(open_sky(40.0, 0.1), with_model(CovarianceModel::kPaper)).source, VisibilitySource::kLidar);
  EXPECT_EQ(gnss_covariance({}, SkyObservation{0.4, 0.9}, std::nullopt, soft).source, VisibilitySource::kLidar);
  EXPECT_EQ(gnss_covariance({}, SkyObservation{0.0, 0.0}, std::nullopt, soft).source, VisibilitySource::kNone);
  EXPECT_EQ(gnss_covariance({}, std::nullopt, std::nullopt, soft).source, VisibilitySource::kNone);
  EXPECT_STREQ(to_string(VisibilitySource::kLidarAndSatellites), "lidar_and_satellites");
}

TEST(SoftGnssCovariance, LidarAloneEnlargesTheClaimByTheShareOfBlockedSky) {
  const Eigen::Matrix2d claim = Eigen::Vector2d(4.0, 9.0).asDiagonal();
  const auto factor = [&](double blocked, double known, const GnssCovarianceParameters& p) {
    const auto result = gnss_covariance({}, SkyObservation{blocked, known}, claim, p);
    EXPECT_TRUE(result.weighted.isApprox(claim * (result.weighted(0, 0) / 4.0), 1e-9)) << "the same in all directions";
    return result.weighted(0, 0) / 4.0;
  };
  EXPECT_EQ(factor(0.0, 1.0, {}), 1.0);
  EXPECT_GT(factor(0.5, 1.0, {}), 20.0);
  EXPECT_GT(factor(0.5, 1.0, {}), factor(0.2, 1.0, {}));
  EXPECT_EQ(factor(0.0, 0.0, {}), 1.0);
  EXPECT_EQ(factor(0.9, 1.0, with_model(CovarianceModel::kConventional)), 1.0);
  // Without a claim: an assumed dilution of precision.
  const auto assumed = gnss_covariance({}, std::nullopt, std::nullopt, {});
  EXPECT_NEAR(position_sigma(assumed.weighted), 1.2 * 3.75, 1e-9);
}

using Rows = std::vector<std::vector<std::string>>;

Rows read_csv(const std::filesystem::path& path) {
  std::ifstream in(path);
  Rows rows;
  std::string line;
  std::getline(in, line);
  while (std::getline(in, line)) {
    std::istringstream cells(line);
    rows.emplace_back();
    for (std::string cell; std::getline(cells, cell, ',');) rows.back().push_back(cell);
  }
  return rows;
}

TEST(SoftGnssCovariance, SoftIsHonestOnRealRecordings) {
  const char* data = std::getenv("URBAN_GNSS_DATA");
  if (data == nullptr) GTEST_SKIP() << "URBAN_GNSS_DATA is not set";
  for (const char* name : {"hk_tst_20210517_ublox", "hk_tst_20210517_xiaomi"}) {
    const auto folder = std::filesystem::path(data) / name;
    if (!std::filesystem::exists(folder)) GTEST_SKIP() << folder << " does not exist";
    std::map<std::string, Eigen::Vector2d> truth;
    for (const auto& row : read_csv(folder / "truth.csv")) truth[row[0]] = {std::stod(row[1]), std::stod(row[2])};
    std::map<std::string, Sky> skies;
    for (const auto& row : read_csv(folder / "sats.csv")) {
      if (row.back() != "1") continue;
      const auto constellation = row[1][0] == 'G' ? Constellation::kGps : Constellation::kBeidou;
      SatelliteObservation s = satellite(std::stoi(row[1].substr(1)), 0.0, 0.0, constellation);
      s.look = {std::stod(row[2]), std::stod(row[3])};
      s.cn0_dbhz = row[4].empty() ? kNaN : std::stod(row[4]);
      skies[row[0]].push_back(s);
    }
    double soft_nees = 0.0;
    double conventional_nees = 0.0;
    int count = 0;
    for (const auto& row : read_csv(folder / "gnss.csv")) {
      if (!truth.count(row[0]) || !skies.count(row[0])) continue;
      const Eigen::Vector2d error = Eigen::Vector2d(std::stod(row[4]), std::stod(row[5])) - truth[row[0]];
      const auto result = compute(skies[row[0]], {});
      soft_nees += error.dot(result.weighted.inverse() * error);
      conventional_nees += error.dot(result.conventional.inverse() * error);
      ++count;
    }
    ASSERT_GT(count, 400) << name;
    EXPECT_GT(soft_nees / count, 0.5) << name;
    EXPECT_LT(soft_nees / count, 4.0) << name;
    EXPECT_GT(conventional_nees / count, 20.0) << name;
  }
}

}  // namespace
}  // namespace urban_gnss
