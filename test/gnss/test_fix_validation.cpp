#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <cmath>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "urban_gnss_localization/gnss/fix_validation.hpp"

namespace urban_gnss {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kMax = std::numeric_limits<double>::max();

const GeodeticPosition kDatum{33.89, 130.84, 30.0};

RawFix good_fix() {
  RawFix raw;
  raw.stamp = from_seconds(100.0);
  raw.position = {33.891, 130.841, 31.0};
  raw.covariance = Eigen::Vector3d(4.0, 9.0, 25.0).asDiagonal();
  raw.covariance_type = CovarianceType::kKnown;
  return raw;
}

RawFix fix_with_covariance(double east, double north, double mixed) {
  RawFix raw = good_fix();
  raw.covariance(0, 0) = east;
  raw.covariance(1, 1) = north;
  raw.covariance(0, 1) = raw.covariance(1, 0) = mixed;
  return raw;
}

ValidatedFix validate(const RawFix& raw, const FixValidationParameters& parameters = {},
                      std::optional<Stamp> last_stamp = std::nullopt) {
  return validate_fix(raw, LocalFrame(kDatum), last_stamp, parameters);
}

FixDecision decision_at(double latitude, double longitude) {
  RawFix raw = good_fix();
  raw.position.latitude_deg = latitude;
  raw.position.longitude_deg = longitude;
  return validate(raw).outcome.decision;
}

Eigen::Matrix2d isotropic(double sigma) { return sigma * sigma * Eigen::Matrix2d::Identity(); }

bool is_near(const Eigen::Matrix2d& a, const Eigen::Matrix2d& b) { return a.isApprox(b, 1e-9); }

TEST(FixValidation, GoodFixIsAcceptedAsDeclared) {
  const RawFix raw = good_fix();
  const ValidatedFix result = validate(raw);
  EXPECT_EQ(result.outcome.decision, FixDecision::kAccepted) << result.outcome.reason;
  EXPECT_FALSE(result.outcome.covariance_clamped);
  EXPECT_EQ(result.outcome.reason, "");
  EXPECT_EQ(result.outcome.stamp, raw.stamp);
  EXPECT_EQ(result.fix.stamp, raw.stamp);
  EXPECT_TRUE(is_near(result.fix.covariance, Eigen::Vector2d(4.0, 9.0).asDiagonal()));
  EXPECT_EQ(result.fix.position, LocalFrame(kDatum).to_local(raw.position).head<2>());
  EXPECT_GT(result.fix.position.minCoeff(), 90.0);
}

TEST(FixValidation, NoFixIsRejectedByStatusBeforeAnythingElse) {
  RawFix raw = good_fix();
  raw.has_fix = false;
  raw.position.latitude_deg = kNaN;
  EXPECT_EQ(validate(raw).outcome.decision, FixDecision::kRejectedStatus);
  EXPECT_FALSE(is_usable_position(raw));
}

TEST(FixValidation, NonFiniteCoordinatesAreRejected) {
  for (const double value : {kNaN, kInfinity, -kInfinity}) {
    EXPECT_EQ(decision_at(value, 130.84), FixDecision::kRejectedNonFinite);
    EXPECT_EQ(decision_at(33.89, value), FixDecision::kRejectedNonFinite);
  }
}

TEST(FixValidation, NoSuchPlaceIsRejected) {
  EXPECT_EQ(decision_at(90.001, 130.84), FixDecision::kRejectedOutOfRange);
  EXPECT_EQ(decision_at(-91.0, 130.84), FixDecision::kRejectedOutOfRange);
  EXPECT_EQ(decision_at(33.89, 180.001), FixDecision::kRejectedOutOfRange);
  EXPECT_EQ(decision_at(33.89, -1e300), FixDecision::kRejectedOutOfRange);
  RawFix raw = good_fix();
  raw.position.longitude_deg -= 360.0;  // the same meridian, but no receiver says it so
  EXPECT_FALSE(is_usable_position(raw));
  EXPECT_EQ(validate(raw).outcome.decision, FixDecision::kRejectedOutOfRange);
}

TEST(FixValidation, LatitudeAndLongitudeBothZeroAreRejected) {
  FixValidationParameters parameters;
  RawFix raw = good_fix();
  raw.position = {0.0, -0.0, 10.0};
  const LocalFrame gulf_of_guinea({0.0001, 0.0001, 0.0});  // the distance from the datum is not what rejects it
  const auto result = validate_fix(raw, gulf_of_guinea, std::nullopt, parameters);
  EXPECT_EQ(result.outcome.decision, FixDecision::kRejectedOutOfRange);
  raw.position.longitude_deg = 1e-5;
  EXPECT_EQ(validate_fix(raw, gulf_of_guinea, std::nullopt, parameters).outcome.decision, FixDecision::kAccepted);
}

TEST(FixValidation, LongitudeOf180IsAPlace) {
  RawFix raw = good_fix();
  for (const double longitude : {180.0, -180.0}) {
    raw.position = {-16.8, longitude, 0.0};
    const auto result = validate_fix(raw, LocalFrame({-16.8, 179.9999, 0.0}), std::nullopt, {});
    EXPECT_EQ(result.outcome.decision, FixDecision::kAccepted) << result.outcome.reason;
    EXPECT_NEAR(result.fix.position.x(), 10.66, 0.01);
  }
}

TEST(FixValidation, FarFromTheDatumIsRejectedEvenAtTheAntipode) {
  FixValidationParameters parameters;
  parameters.max_distance_from_datum = 1000.0;
  RawFix raw = good_fix();
  raw.position.latitude_deg = kDatum.latitude_deg + 0.008;  // 887 m
  EXPECT_EQ(validate(raw, parameters).outcome.decision, FixDecision::kAccepted);
  raw.position.latitude_deg = kDatum.latitude_deg + 0.010;  // 1109 m
  EXPECT_EQ(validate(raw, parameters).outcome.decision, FixDecision::kRejectedOutOfRange);
  EXPECT_EQ(decision_at(-kDatum.latitude_deg, kDatum.longitude_deg - 180.0), FixDecision::kRejectedOutOfRange);
}

TEST(FixValidation, HeightIsNoDistance) {
  FixValidationParameters parameters;
  parameters.max_distance_from_datum = 1000.0;
  RawFix raw = good_fix();
  raw.position.altitude_m = 2500.0;  // the datum's height was left at 30 m
  EXPECT_EQ(validate(raw, parameters).outcome.decision, FixDecision::kAccepted);
}

TEST(FixValidation, NegativeStampIsRejected) {
  RawFix raw = good_fix();
  for (const Stamp stamp : {Stamp(-1), Stamp::min()}) {
    raw.stamp = stamp;
    EXPECT_EQ(validate(raw).outcome.decision, FixDecision::kRejectedOutOfRange);
  }
  raw.stamp = Stamp(0);
  EXPECT_EQ(validate(raw).outcome.decision, FixDecision::kAccepted);
}

TEST(FixValidation, StampMustBeNewerThanTheLast) {
  const RawFix raw = good_fix();
  const auto duplicate = validate(raw, {}, raw.stamp);
  EXPECT_EQ(duplicate.outcome.decision, FixDecision::kRejectedStale);
  EXPECT_NE(duplicate.outcome.reason.find("duplicate"), std::string::npos);
  const auto older = validate(raw, {}, raw.stamp + from_seconds(0.5));
  EXPECT_EQ(older.outcome.decision, FixDecision::kRejectedStale);
  EXPECT_EQ(older.outcome.reason, "0.5 s older than the last fix");
  EXPECT_EQ(validate(raw, {}, raw.stamp - Stamp(1)).outcome.decision, FixDecision::kAccepted);
}

TEST(FixValidation, UnusableAltitudeDoesNotDropTheFix) {
  RawFix raw = good_fix();
  raw.position.altitude_m = kDatum.altitude_m;
  const Eigen::Vector2d expected = validate(raw).fix.position;
  for (const double altitude : {kNaN, kInfinity, -kInfinity, kMax, -1e9}) {
    raw.position.altitude_m = altitude;
    const auto result = validate(raw);
    EXPECT_EQ(result.outcome.decision, FixDecision::kAccepted);
    EXPECT_EQ(result.fix.position, expected);
    EXPECT_NE(result.outcome.reason.find("altitude"), std::string::npos);
  }
}

TEST(FixValidation, RejectedFixHoldsNothingButTheStamp) {
  RawFix raw = good_fix();
  raw.position.latitude_deg = kNaN;
  raw.covariance.setConstant(kNaN);
  const auto result = validate(raw);
  EXPECT_EQ(result.fix.stamp, raw.stamp);
  EXPECT_EQ(result.fix.position, Eigen::Vector2d::Zero());
  EXPECT_EQ(result.fix.covariance, Eigen::Matrix2d::Identity());
  EXPECT_TRUE(is_rejected(result.outcome.decision));
}

TEST(FixValidation, CovarianceThatCannotBeUsedIsTheDefault) {
  FixValidationParameters parameters;
  parameters.fix_sigma_default = 7.0;
  RawFix unknown = good_fix();
  unknown.covariance_type = CovarianceType::kUnknown;
  const RawFix unusable[] = {unknown,
                             fix_with_covariance(0.0, 0.0, 0.0),
                             fix_with_covariance(4.0, 0.0, 0.0),
                             fix_with_covariance(-4.0, 4.0, 0.0),
                             fix_with_covariance(4.0, kNaN, 0.0),
                             fix_with_covariance(4.0, 4.0, kNaN),
                             fix_with_covariance(kInfinity, 4.0, 0.0),
                             fix_with_covariance(4.0, 4.0, kInfinity),
                             fix_with_covariance(4.0, 4.0, 5.0),
                             fix_with_covariance(4.0, 4.0, -4.0),
                             fix_with_covariance(1.0, 1.0, kMax)};
  for (const RawFix& raw : unusable) {
    const auto result = validate(raw, parameters);
    EXPECT_EQ(result.outcome.decision, FixDecision::kInflated) << raw.covariance;
    EXPECT_TRUE(result.outcome.covariance_clamped);
    EXPECT_NE(result.outcome.reason.find("default sigma 7 m"), std::string::npos) << result.outcome.reason;
    EXPECT_TRUE(is_near(result.fix.covariance, isotropic(7.0))) << result.fix.covariance;
  }
}

TEST(FixValidation, VerticalCovarianceDoesNotMatter) {
  RawFix raw = good_fix();
  raw.covariance.row(2).setConstant(kNaN);
  raw.covariance.col(2).setConstant(kNaN);
  EXPECT_EQ(validate(raw).outcome.decision, FixDecision::kAccepted);
}

TEST(FixValidation, MillimetresAndSquaredDegreesAreRaisedToTheFloor) {
  for (const double variance : {9e-6, 1e-10, 1e-300, std::numeric_limits<double>::denorm_min()}) {
    const auto result = validate(fix_with_covariance(variance, variance, 0.0));
    EXPECT_EQ(result.outcome.decision, FixDecision::kInflated);
    EXPECT_TRUE(result.outcome.covariance_clamped);
    EXPECT_NE(result.outcome.reason.find("floor"), std::string::npos) << result.outcome.reason;
    EXPECT_TRUE(is_near(result.fix.covariance, isotropic(0.3)));
  }
}

TEST(FixValidation, HugeVariancesAreLoweredToTheCeiling) {
  for (const double variance : {1.1e6, 1e10, 1e200, kMax}) {
    const auto result = validate(fix_with_covariance(variance, variance, 0.0));
    EXPECT_EQ(result.outcome.decision, FixDecision::kAccepted) << result.outcome.reason;
    EXPECT_TRUE(result.outcome.covariance_clamped);
    EXPECT_NE(result.outcome.reason.find("ceiling"), std::string::npos) << result.outcome.reason;
    EXPECT_TRUE(is_near(result.fix.covariance, isotropic(1000.0))) << result.fix.covariance;
  }
}

TEST(FixValidation, AxesAreClampedEachOnItsOwn) {
  for (const double huge : {1e10, 1e100, kMax}) {
    const Eigen::Matrix2d covariance = validate(fix_with_covariance(huge, 4.0, 0.0)).fix.covariance;
    EXPECT_NEAR(covariance(0, 0), 1e6, 1e-2);
    EXPECT_NEAR(covariance(1, 1), 4.0, 1e-6);
  }
  const auto both = validate(fix_with_covariance(kMax, 1e-8, 0.0));
  EXPECT_EQ(both.outcome.decision, FixDecision::kInflated);
  EXPECT_NEAR(both.fix.covariance(1, 1), 0.09, 1e-9);
}

TEST(FixValidation, CorrelationIsKept) {
  // A street canyon at 30 degrees: 20 m across, 0.1 m along.
  const Eigen::Matrix2d rotation = Eigen::Rotation2Dd(M_PI / 6.0).toRotationMatrix();
  const auto ellipse = [&](double along, double across) -> Eigen::Matrix2d {
    return rotation * Eigen::Vector2d(along * along, across * across).asDiagonal() * rotation.transpose();
  };
  RawFix raw = good_fix();
  raw.covariance.topLeftCorner<2, 2>() = ellipse(2.0, 20.0);
  EXPECT_TRUE(is_near(validate(raw).fix.covariance, ellipse(2.0, 20.0)));
  EXPECT_EQ(validate(raw).outcome.decision, FixDecision::kAccepted);
  raw.covariance.topLeftCorner<2, 2>() = ellipse(0.1, 20.0);
  EXPECT_TRUE(is_near(validate(raw).fix.covariance, ellipse(0.3, 20.0)));
  raw.covariance.topLeftCorner<2, 2>() = ellipse(0.1, 2000.0);
  EXPECT_TRUE(validate(raw).fix.covariance.isApprox(ellipse(0.3, 1000.0), 1e-6));
}

TEST(FixValidation, CovarianceIsSymmetrised) {
  RawFix raw = good_fix();
  raw.covariance(0, 1) = 3.0;
  raw.covariance(1, 0) = 1.0;
  const Eigen::Matrix2d covariance = validate(raw).fix.covariance;
  EXPECT_NEAR(covariance(0, 1), 2.0, 1e-12);
  EXPECT_EQ(covariance(0, 1), covariance(1, 0));
}

TEST(FixValidation, OffDiagonalsAreNotReadWhereOnlyTheDiagonalIsKnown) {
  RawFix raw = fix_with_covariance(4.0, 9.0, kNaN);
  raw.covariance_type = CovarianceType::kDiagonalKnown;
  EXPECT_TRUE(is_near(validate(raw).fix.covariance, Eigen::Vector2d(4.0, 9.0).asDiagonal()));
}

TEST(FixValidation, EveryParameterHasAnEffect) {
  FixValidationParameters parameters;
  parameters.fix_covariance_scale = 4.0;
  EXPECT_TRUE(is_near(validate(good_fix(), parameters).fix.covariance, Eigen::Vector2d(16.0, 36.0).asDiagonal()));
  parameters = {};
  parameters.fix_sigma_floor = 4.0;
  EXPECT_TRUE(is_near(validate(good_fix(), parameters).fix.covariance, isotropic(4.0)));
  parameters = {};
  parameters.fix_sigma_ceiling = 2.5;
  EXPECT_TRUE(is_near(validate(good_fix(), parameters).fix.covariance, Eigen::Vector2d(4.0, 6.25).asDiagonal()));
}

TEST(FixValidation, ParametersMustBeInOrder) {
  std::vector<std::string> faults;
  FixValidationParameters parameters;
  faults = faults_of(parameters);
  EXPECT_TRUE(faults.empty());
  parameters.fix_sigma_default = 0.1;
  faults = faults_of(parameters);
  ASSERT_EQ(faults.size(), 1u);
  EXPECT_NE(faults[0].find("fix_sigma_default"), std::string::npos);
  faults.clear();
  parameters.fix_sigma_floor = 3000.0;
  faults = faults_of(parameters);
  ASSERT_EQ(faults.size(), 1u);
  EXPECT_NE(faults[0].find("fix_sigma_floor"), std::string::npos);
}

TEST(FixValidation, NothingReceivedLeadsToANonFiniteResult) {
  const double nasty[] = {0.0,
                          -0.0,
                          1.0,
                          -1.0,
                          90.0,
                          -180.0,
                          180.0,
                          33.89,
                          130.84,
                          1e-12,
                          -1e-9,
                          25.0,
                          1e10,
                          1e155,
                          -1e160,
                          kMax,
                          -kMax,
                          kNaN,
                          kInfinity,
                          -kInfinity,
                          std::numeric_limits<double>::min(),
                          std::numeric_limits<double>::denorm_min()};
  const Stamp stamps[] = {Stamp::min(), Stamp(-1), Stamp(0), Stamp(1), from_seconds(100.0), Stamp::max()};
  std::mt19937_64 generator(20130917);
  const auto pick = [&](const auto& values) {
    return values[std::uniform_int_distribution<std::size_t>(0, std::size(values) - 1)(generator)];
  };
  const LocalFrame frame(kDatum);
  FixValidationParameters scaled_up;
  scaled_up.fix_covariance_scale = 1e300;
  const FixValidationParameters parameter_sets[] = {{}, scaled_up};

  std::size_t used = 0;
  for (int trial = 0; trial < 200000; ++trial) {
    RawFix raw;
    raw.stamp = pick(stamps);
    raw.has_fix = trial % 16 != 0;
    const bool is_at_datum = trial % 2 == 0;  // else hardly any passes the distance
    raw.position = {is_at_datum ? 33.89 : pick(nasty), is_at_datum ? 130.84 : pick(nasty), pick(nasty)};
    for (int i = 0; i < 9; ++i) raw.covariance(i) = pick(nasty);
    raw.covariance_type = static_cast<CovarianceType>(trial % 4);
    const std::optional<Stamp> last = trial % 3 == 0 ? std::optional<Stamp>(pick(stamps)) : std::nullopt;

    const auto [fix, outcome] = validate_fix(raw, frame, last, parameter_sets[trial % 5 == 0]);
    ASSERT_TRUE(fix.position.allFinite());
    ASSERT_TRUE(fix.covariance.allFinite());
    ASSERT_NE(outcome.decision, FixDecision::kNotExamined);
    if (is_rejected(outcome.decision)) {
      ASSERT_FALSE(outcome.reason.empty());
      continue;
    }
    ++used;
    ASSERT_TRUE(is_usable_position(raw));
    ASSERT_EQ(fix.covariance(0, 1), fix.covariance(1, 0));
    ASSERT_EQ(fix.covariance.llt().info(), Eigen::Success) << fix.covariance;
    const Eigen::Vector2d variances = Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(fix.covariance).eigenvalues();
    ASSERT_GE(variances.minCoeff(), 0.09 * (1.0 - 1e-6)) << raw.covariance;
    ASSERT_LE(variances.maxCoeff(), 1e6 * (1.0 + 1e-9)) << raw.covariance;
  }
  EXPECT_GT(used, 10000u);
}

}  // namespace
}  // namespace urban_gnss
