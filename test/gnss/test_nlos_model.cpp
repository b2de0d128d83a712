#include <gtest/gtest.h>

#include <cmath>

#include "satellite_sky.hpp"
#include "urban_gnss_localization/geometry/angles.hpp"
#include "urban_gnss_localization/gnss/nlos_model.hpp"

namespace urban_gnss {
namespace {

NlosParameters with_law(NlosElevationLaw law, double exponent) {
  NlosParameters p;
  p.mean = 20.0;
  p.sigma = 12.0;
  p.elevation_law = law;
  p.elevation_exponent = exponent;
  return p;
}

TEST(NlosModel, ParametersAreThoseAtTheReferenceElevation) {
  for (const NlosElevationLaw law : {NlosElevationLaw::kCotangent, NlosElevationLaw::kCosecant}) {
    const NlosRange range = nlos_range(kNlosReferenceElevation_rad, with_law(law, 1.7));
    EXPECT_NEAR(range.mean_m, 20.0, 1e-9);
    EXPECT_NEAR(range.sigma_m, 12.0, 1e-9);
    EXPECT_NEAR(nlos_range(kNlosReferenceElevation_rad, with_law(law, 1.7), 0.5).mean_m, 10.0, 1e-9);
  }
}

TEST(NlosModel, ExcessGrowsTowardsTheHorizonByItsLaw) {
  const NlosParameters cotangent = with_law(NlosElevationLaw::kCotangent, 1.0);
  EXPECT_NEAR(nlos_range(degrees_to_radians(45.0), cotangent).mean_m, 20.0 * 0.75, 1e-9);
  EXPECT_NEAR(nlos_range(degrees_to_radians(90.0), cotangent).mean_m, 0.0, 1e-9);
  EXPECT_EQ(nlos_range(degrees_to_radians(5.0), cotangent).mean_m,
            nlos_range(degrees_to_radians(15.0), cotangent).mean_m);
  const NlosParameters cosecant = with_law(NlosElevationLaw::kCosecant, 2.0);
  EXPECT_NEAR(nlos_range(degrees_to_radians(30.0), cosecant).sigma_m, 12.0 * 1.44, 1e-9);
  EXPECT_NEAR(nlos_range(degrees_to_radians(90.0), cosecant).sigma_m, 12.0 * 0.36, 1e-9);
  EXPECT_EQ(nlos_range(degrees_to_radians(1.0), cosecant).mean_m, nlos_range(degrees_to_radians(5.0), cosecant).mean_m);
  for (const NlosElevationLaw law : {NlosElevationLaw::kCotangent, NlosElevationLaw::kCosecant}) {
    EXPECT_EQ(nlos_range(0.3, with_law(law, 0.0)).mean_m, 20.0);
  }
}

TEST(NlosModel, OddsAreEvenAtTheirCn0) {
  NlosParameters p;
  p.cn0_width = 3.0;
  p.cn0_rise = 8.0;
  SatelliteObservation s = satellite(1, 0.0, 90.0, Constellation::kGps);
  EXPECT_NEAR(cn0_gain_db(s.look.elevation_rad, p), 3.2, 1e-9);
  s.cn0_dbhz = 28.0 + 3.2;
  EXPECT_NEAR(levelled_cn0_dbhz(s, p), 28.0, 1e-9);
  EXPECT_EQ(nlos_log_odds(0.0, p), 0.0);
  EXPECT_NEAR(nlos_log_odds(6.0, p), 2.0, 1e-9);
  EXPECT_NEAR(nlos_log_odds(-3.0, p), -1.0, 1e-9);
}

TEST(NlosModel, ProbabilityIsTheInverseOfLogOdds) {
  for (const double p : {1e-9, 0.02, 0.5, 0.98}) EXPECT_NEAR(probability_of(log_odds(p)), p, 1e-12);
  EXPECT_GT(probability_of(-1e9), 0.0);
  EXPECT_LT(probability_of(1e9), 1.0);
}

}  // namespace
}  // namespace urban_gnss
