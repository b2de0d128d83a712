#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "urban_gnss_localization/common/random.hpp"
#include "urban_gnss_localization/geometry/angles.hpp"
#include "urban_gnss_localization/simulation/correlator.hpp"

namespace urban_gnss {
namespace {

/// The envelope in closed form, chips, for one interference of signed amplitude m and delay in chips: the straight
/// pieces of the discriminator solved by hand.
double envelope(double m, double delay, double spacing) {
  const double rising_end = 0.5 * spacing * (1.0 + m);
  if (delay <= rising_end) return m * delay / (1.0 + m);
  if (delay <= 1.0 - 0.5 * spacing + 0.5 * spacing * m) return 0.5 * spacing * m;
  if (delay <= 1.0 + 0.5 * spacing) return m * (1.0 + 0.5 * spacing - delay) / (2.0 - m);
  return 0.0;
}

TEST(Correlator, OneInterferenceGivesTheKnownEnvelope) {
  for (const double spacing : {0.1, 0.5}) {
    for (const double m : {-0.9, -0.5, -0.1, 0.1, 0.5, 0.9}) {
      for (double delay = 0.0; delay < 1.8; delay += 0.013) {
        const std::vector<Interference> one{{delay * kChip_m, std::abs(m), m < 0.0 ? kPi : 0.0}};
        ASSERT_NEAR(multipath_error_m(one, spacing) / kChip_m, envelope(m, delay, spacing), 1e-6)
            << "spacing " << spacing << " m " << m << " delay " << delay;
      }
    }
  }
}

TEST(Correlator, ErrorIsWithinHalfTheSpacingWhateverInterferes) {
  RandomEngine engine = make_engine(8);
  for (int trial = 0; trial < 5000; ++trial) {
    std::vector<Interference> interferences(1 + trial % 6);
    for (Interference& one : interferences) {
      one = {400.0 * draw_normal(engine), 3.0 * draw_uniform(engine), 6.3 * draw_uniform(engine)};
    }
    const double spacing = 0.05 + 0.95 * draw_uniform(engine);
    const double error_m = multipath_error_m(interferences, spacing);
    ASSERT_LE(std::abs(error_m), 0.5 * spacing * kChip_m + 1e-6);
    ASSERT_LE(std::abs(error_m), 0.5 * kChip_m);
    for (Interference& one : interferences) one.delay_m = -one.delay_m;
    ASSERT_NEAR(multipath_error_m(interferences, spacing), -error_m, 1e-3 + 1e-6 * kChip_m) << trial;
  }
}

TEST(Correlator, NothingAndQuadratureDoNotDisturb) {
  EXPECT_NEAR(multipath_error_m({}, 0.5), 0.0, 1e-6);
  EXPECT_NEAR(multipath_error_m({{30.0, 0.8, 0.5 * kPi}}, 0.5), 0.0, 1e-6);
  EXPECT_NEAR(multipath_error_m({{600.0, 0.8, 0.0}}, 0.5), 0.0, 1e-6);
}

TEST(Correlator, NoiseOfTheCodeLoop) {
  // 293.0523 m sqrt(0.5 x 0.5 / (2 x 31622.78)) sqrt(1 + 2 / (1.5 x 0.02 x 31622.78))
  EXPECT_NEAR(code_noise_sigma_m(45.0, 0.5, 0.5, 0.02), 0.58325, 1e-4);
  EXPECT_NEAR(code_noise_sigma_m(45.0, 2.0, 0.5, 0.02), 2.0 * 0.58325, 2e-4);
  // At 20 dB-Hz the squaring loss is 1 + 2 / 3.
  EXPECT_NEAR(code_noise_sigma_m(20.0, 0.5, 0.5, 0.02), 293.0523 * std::sqrt(0.25 / 200.0 * 5.0 / 3.0), 1e-2);
}

}  // namespace
}  // namespace urban_gnss
