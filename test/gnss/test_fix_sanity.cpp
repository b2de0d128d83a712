#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "urban_gnss_localization/gnss/fix_sanity.hpp"

namespace urban_gnss {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kDefault_m = 4.0;

using Type = CovarianceType;

/// The k-th fix of a stream with these variances (m^2).
RawFix fix(int k, const Eigen::Vector3d& variances, Type type) {
  RawFix raw;
  raw.stamp = from_seconds(1000.0 + k);
  raw.position = {48.1374 + 1e-5 * k, 11.5755, 520.0};
  raw.covariance = variances.asDiagonal();
  raw.covariance_type = type;
  return raw;
}

/// What came of a stream.
struct Result {
  std::vector<std::string> warnings;
  std::vector<std::string> notes;
  SaneFix last;
  std::string complaint;

  bool is_silent() const { return warnings.empty() && notes.empty() && last.reason.empty() && complaint.empty(); }
};

/// `make(k)` is the k-th of `count` fixes.
template <class Make>
Result run(int count, const Make& make, const FixValidationParameters& parameters = {}) {
  FixSanity sanity(parameters);
  Result result;
  for (int k = 0; k < count; ++k) {
    result.last = sanity.add(make(k));
    for (const FixSanity::News& news : sanity.take_news()) {
      (news.is_warning ? result.warnings : result.notes).push_back(news.text);
    }
  }
  result.complaint = sanity.complaint();
  return result;
}

void expect_one_warning(const Result& result, const std::string& text) {
  ASSERT_EQ(result.warnings.size(), 1u) << text;
  EXPECT_NE(result.warnings.front().find(text), std::string::npos) << result.warnings.front();
}

/// gpsd's estimates, as its JSON has them: metres with three decimals.
RawFix of_gpsd_client(int k) {
  const auto three_decimals = [](double value) { return std::round(1000.0 * value) / 1000.0; };
  const double xdop = 0.5 + 0.1 * std::sin(0.3 * k);
  return fix(k, {three_decimals(15.0 * xdop), three_decimals(17.1 * xdop), three_decimals(29.3 * xdop)},
             Type::kDiagonalKnown);
}

TEST(FixSanity, SigmaInPlaceOfItsSquare) {
  const Result result = run(60, of_gpsd_client);
  expect_one_warning(result, "gpsd_client");
  EXPECT_NE(result.last.reason, "");
  EXPECT_EQ(result.complaint, "gps/fix has sigma in place of its square");
  const RawFix raw = of_gpsd_client(59);
  EXPECT_DOUBLE_EQ(result.last.fix.covariance(0, 0), std::pow(raw.covariance(0, 0), 2));
  EXPECT_DOUBLE_EQ(result.last.fix.covariance(1, 1), std::pow(raw.covariance(1, 1), 2));
  EXPECT_TRUE(run(9, of_gpsd_client).is_silent()) << "too few to tell";
  const auto without_height = [](int k) {
    RawFix raw = of_gpsd_client(k);
    raw.covariance(2, 2) = kNaN;  // a 2D fix
    return raw;
  };
  expect_one_warning(run(60, without_height), "gpsd_client");
}

RawFix of_old_nmea_driver(int k) {
  const double hdop = 0.8 + 0.1 * (k / 7 % 5);
  return fix(k, {hdop * hdop, hdop * hdop, 4.0 * hdop * hdop}, Type::kApproximated);
}

TEST(FixSanity, HdopSquared) {
  const Result result = run(60, of_old_nmea_driver);
  expect_one_warning(result, "HDOP^2");
  const double hdop2 = of_old_nmea_driver(59).covariance(0, 0);
  EXPECT_NEAR(result.last.fix.covariance(0, 0), kDefault_m * kDefault_m * hdop2, 1e-9);
  EXPECT_NEAR(result.last.fix.covariance(1, 1), kDefault_m * kDefault_m * hdop2, 1e-9);
  const auto of_mavros = [](int k) {  // single precision, and VDOP upwards
    const double hdop = static_cast<float>(70 + 3 * (k / 4 % 6)) / 1e2F;
    const double vdop = static_cast<float>(120 + k % 9) / 1e2F;
    return fix(k, {hdop * hdop, hdop * hdop, vdop * vdop}, Type::kApproximated);
  };
  expect_one_warning(run(60, of_mavros), "mavros");
}

TEST(FixSanity, SbasDecimetre) {
  const auto of_nmea_driver = [](int k, bool has_sbas) {
    const double sigma = 0.1 * (0.9 + 0.01 * (k % 2));
    RawFix raw = fix(k, {sigma * sigma, sigma * sigma, 16.0 * sigma * sigma}, Type::kApproximated);
    raw.has_sbas = has_sbas;
    return raw;
  };
  const Result result = run(20, [&](int k) { return of_nmea_driver(k, true); });
  expect_one_warning(result, "SBAS");
  EXPECT_NEAR(std::sqrt(result.last.fix.covariance(0, 0)), kDefault_m * 0.91, 1e-9);
  EXPECT_TRUE(run(20, [&](int k) { return of_nmea_driver(k, false); }).is_silent());
  const auto plain = [](int k) {  // its epe_quality1
    const double sigma = kDefault_m * (0.9 + 0.01 * (k % 5));
    return fix(k, {sigma * sigma, sigma * sigma, 16.0 * sigma * sigma}, Type::kApproximated);
  };
  EXPECT_TRUE(run(60, plain).is_silent());
}

TEST(FixSanity, SquareDegrees) {
  const auto in_square_degrees = [](int k) {
    const double sigma_deg = (2.0 + 0.3 * std::sin(k)) / 111e3;
    return fix(k, {sigma_deg * sigma_deg, sigma_deg * sigma_deg, 4.0}, Type::kKnown);
  };
  const Result result = run(20, in_square_degrees);
  expect_one_warning(result, "square degrees");
  EXPECT_EQ(result.last.fix.covariance(0, 0), kDefault_m * kDefault_m);
}

TEST(FixSanity, WhatTheValidationReplacesIsOnlySaid) {
  const auto of = [](const Eigen::Vector3d& variances, Type type) {
    return run(40, [&](int k) { return fix(k, variances, type); });
  };
  expect_one_warning(of({0.0, 0.0, 0.0}, Type::kKnown), "zeros");
  expect_one_warning(of({0.0, 0.0, 0.0}, Type::kApproximated), "zeros");
  expect_one_warning(of({kNaN, kNaN, kNaN}, Type::kDiagonalKnown), "NaN");
  expect_one_warning(of({-1.0, -1.0, -1.0}, Type::kKnown), "negative");
  expect_one_warning(of({4.0, std::numeric_limits<double>::infinity(), 4.0}, Type::kKnown), "infinite");
  const double largest = std::numeric_limits<double>::max();
  expect_one_warning(of({largest, largest, largest}, Type::kApproximated), "unknown");
  expect_one_warning(of({2250000.0, 2250000.0, 9000000.0}, Type::kDiagonalKnown), "1500 m");
  expect_one_warning(of({4.0, 4.0, 9.0}, Type::kUnknown), "position_covariance_type");
  EXPECT_EQ(of({4.0, 4.0, 9.0}, Type::kUnknown).last.fix.covariance(0, 0), 4.0);
  EXPECT_EQ(of({4.0, 4.0, 9.0}, Type::kUnknown).last.reason, "");
}

TEST(FixSanity, AConstantIsForInformation) {
  const auto constant = [](int k) { return fix(k, {2.25, 2.25, 9.0}, Type::kDiagonalKnown); };
  EXPECT_TRUE(run(99, constant).is_silent());
  const Result result = run(300, constant);
  EXPECT_TRUE(result.warnings.empty());
  ASSERT_EQ(result.notes.size(), 1u);
  EXPECT_NE(result.notes.front().find("1.5 m"), std::string::npos) << result.notes.front();
  EXPECT_EQ(result.complaint, "");
  EXPECT_EQ(result.last.fix.covariance(0, 0), 2.25);
}

TEST(FixSanity, MisplacedFixesAreSaidOnceTheyAreNoAccident) {
  const auto scaled = [](int k) {
    RawFix raw = fix(k, {2.0, 2.0, 4.0}, Type::kUnknown);
    raw.position.latitude_deg *= 1e7;
    raw.position.longitude_deg *= 1e7;
    return raw;
  };
  EXPECT_TRUE(run(2, scaled).is_silent());
  expect_one_warning(run(20, scaled), "degrees times 1e7");
  const auto in_radians = [](int k) {
    RawFix raw = fix(k, {0.0, 0.0, 0.0}, Type::kUnknown);
    raw.position = {0.8402 + 1e-7 * k, 0.2020, 520.0};
    return raw;
  };
  expect_one_warning(run(20, in_radians), "radians");
}

TEST(FixSanity, ACorrectedCovarianceIsLeft) {
  FixValidationParameters parameters;
  parameters.fix_covariance_scale = 9.0;
  const Result result = run(60, of_old_nmea_driver, parameters);
  expect_one_warning(result, "fix_covariance_scale");
  EXPECT_EQ(result.last.fix.covariance, of_old_nmea_driver(59).covariance);
  EXPECT_EQ(result.last.reason, "");
}

TEST(FixSanity, TheReplacementEndsWithTheMistake) {
  const auto repaired = [](int k) {
    return k < 50 ? of_old_nmea_driver(k) : fix(k, {3.1 + 0.01371 * k, 2.9, 7.0}, Type::kKnown);
  };
  EXPECT_NE(run(50, repaired).last.reason, "");
  const Result result = run(51, repaired);
  EXPECT_EQ(result.warnings.size(), 1u);
  EXPECT_EQ(result.last.reason, "");
  EXPECT_EQ(result.complaint, "");
}

/// Receivers that say what they mean.
TEST(FixSanity, HonestStreamsAreSilent) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> accuracy(0.4, 8.0);
  const auto in_steps = [](double value, double step) { return step * std::round(value / step); };
  const auto squares = [](double x, double y, double z) { return Eigen::Vector3d(x * x, y * y, z * z); };
  for (const Type type : {Type::kApproximated, Type::kDiagonalKnown, Type::kKnown}) {
    for (const double step : {0.001, 0.1, 1e-9}) {  // accuracy in millimetres, of GST in decimetres, in full
      const auto made = [&](int k) {
        const double horizontal = in_steps(accuracy(random), step);
        return fix(k, squares(horizontal, horizontal, in_steps(1.7 * accuracy(random), step)), type);
      };
      const auto as_axes = [&](int k) {
        return fix(k, squares(in_steps(accuracy(random), step), in_steps(accuracy(random), step), 3.0), type);
      };
      EXPECT_TRUE(run(400, made).is_silent()) << step;
      EXPECT_TRUE(run(400, as_axes).is_silent()) << step;
    }
  }
  const auto correlated = [&](int k) {
    RawFix raw = fix(k, {4.125, 3.25, 9.0}, Type::kKnown);
    raw.covariance(0, 1) = raw.covariance(1, 0) = 0.001 * k;
    return raw;
  };
  EXPECT_TRUE(run(400, correlated).is_silent());
  EXPECT_TRUE(run(400,
                  [](int k) {
                    return fix(k, {0.0, 0.0, 0.0}, Type::kUnknown);
                  })
                  .is_silent())
      << "says that it knows nothing";
  EXPECT_TRUE(run(400, [](int k) { return fix(k, {-1.0, 0.0, 0.0}, Type::kUnknown); }).is_silent()) << "mavros";
  const auto rtk = [&](int k) {
    const double sigma = 0.02 * (0.5 + 0.01 * (k % 4));
    return fix(k, squares(sigma, sigma, 4.0 * sigma), Type::kApproximated);
  };
  EXPECT_TRUE(run(400, rtk).is_silent());
}

TEST(FixSanity, AFixWithoutPositionSaysNothing) {
  const auto no_fix = [](int k) {
    RawFix raw = fix(k, {0.0, 0.0, 0.0}, Type::kKnown);
    raw.has_fix = false;
    raw.position = {4.8e8, 1e8, 0.0};
    return raw;
  };
  EXPECT_TRUE(run(400, no_fix).is_silent());
}

}  // namespace
}  // namespace urban_gnss
