#include <gtest/gtest.h>

#include "urban_gnss_localization/common/random.hpp"
#include "urban_gnss_localization/gnss/inert_gate.hpp"

namespace urban_gnss {
namespace {

/// NIS of an innovation that is `scale` of what its covariance says.
double draw_nis(RandomEngine& engine, double scale) {
  const double x = scale * draw_normal(engine);
  const double y = scale * draw_normal(engine);
  return x * x + y * y;
}

TEST(InertGate, IsOneThatFindsNothing) {
  InertGate gate({});
  RandomEngine engine = make_engine(3);
  for (int k = 0; k < 1000; ++k) {
    gate.add(draw_nis(engine, 1.0));
    EXPECT_FALSE(gate.is_inert()) << k;
  }
  for (int k = 0; k < InertGateParameters().inert_window; ++k) gate.add(draw_nis(engine, 0.1));
  EXPECT_TRUE(gate.is_inert());
  gate.reset();
  gate.add(0.0);
  EXPECT_FALSE(gate.is_inert()) << "one fix is no run";
}

TEST(InertGate, FalseAlarmsComeAtTheirRateAndEveryParameterHasAnEffect) {
  const auto alarms = [](const InertGateParameters& parameters) {
    constexpr int kRuns = 20000;
    RandomEngine engine = make_engine(4);
    int found = 0;
    for (int run = 0; run < kRuns; ++run) {
      InertGate gate(parameters);
      for (int k = 0; k < 10; ++k) gate.add(draw_nis(engine, 1.0));
      found += gate.is_inert();
    }
    return static_cast<double>(found) / kRuns;
  };
  EXPECT_NEAR(alarms({10, 0.05}), 0.05, 4.5 * 0.0015);
  EXPECT_NEAR(alarms({10, 0.01}), 0.01, 4.5 * 0.0007);
  EXPECT_EQ(alarms({11, 0.05}), 0.0);
}

}  // namespace
}  // namespace urban_gnss
