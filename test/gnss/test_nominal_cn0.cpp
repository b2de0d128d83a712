#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "range_rig.hpp"
#include "urban_gnss_localization/gnss/nominal_cn0.hpp"

namespace urban_gnss {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

TEST(NominalCn0, IsTheUpperDecile) {
  const auto level_of = [](int weak, int strong) {
    NominalCn0 nominal;
    SatelliteObservation s = satellite(1, 0.0, radians_to_degrees(std::asin(0.6)));
    for (int i = 0; i < weak + strong; ++i) {
      s.cn0_dbhz = i < strong ? 45.0 : 30.0;
      nominal.add({s}, {});
    }
    return nominal.dbhz();
  };
  EXPECT_FALSE(level_of(0, 0));
  EXPECT_EQ(level_of(0, 1), 45.0);
  EXPECT_EQ(level_of(95, 5), 30.0);
  EXPECT_EQ(level_of(85, 15), 45.0);

  NominalCn0 nominal;
  RandomEngine engine = make_engine(110);
  std::vector<double> values;
  for (int i = 0; i < 2000; ++i) {
    Sky sky = open_sky();
    for (SatelliteObservation& s : sky) {
      set_cn0(s, kNominalCn0 - values.emplace_back(35.0 + 4.0 * draw_normal(engine)));
    }
    nominal.add(sky, {});
  }
  std::sort(values.begin(), values.end());
  EXPECT_NEAR(*nominal.dbhz(), values[values.size() * 9 / 10], 0.6);
}

TEST(NominalCn0, KnowsTheAntenna) {
  const auto level_at = [](double elevation_deg, double rise) {
    NlosParameters p;
    p.cn0_rise = rise;
    NominalCn0 nominal;
    SatelliteObservation s = satellite(1, 10.0, elevation_deg);
    s.cn0_dbhz = 40.0;
    nominal.add({s}, p);
    return nominal.dbhz();
  };
  EXPECT_EQ(level_at(90.0, 10.0), 36.0);
  EXPECT_EQ(level_at(0.0, 10.0), 46.0);
  EXPECT_EQ(level_at(0.0, 0.0), 40.0);
  EXPECT_EQ(level_at(90.0, -10.0), 44.0);
}

TEST(NominalCn0, LeavesOutWhatIsNoSignal) {
  NominalCn0 nominal;
  SatelliteObservation s = satellite(1, 10.0, 90.0);
  nominal.add({}, {});
  nominal.add({s}, {});  // without C/N0
  for (const double cn0 : {kNaN, 0.0, -3.0, kInfinity}) {
    s.cn0_dbhz = cn0;
    nominal.add({s}, {});
  }
  s.cn0_dbhz = 40.0;
  for (const LookAngles& look : {LookAngles{0.0, -0.1}, LookAngles{0.0, kNaN}, LookAngles{kNaN, 0.5}}) {
    s.look = look;
    nominal.add({s}, {});
  }
  s.look = {0.0, 0.5 * kPi};
  s.tracked = false;
  nominal.add({s}, {});
  EXPECT_FALSE(nominal.dbhz());
  s.tracked = true;
  nominal.add({s}, {});
  EXPECT_EQ(nominal.dbhz(), 36.0);
  for (const double cn0 : {1e300, 1e-300}) {
    s.cn0_dbhz = cn0;
    nominal.add({s}, {});
  }
  EXPECT_TRUE(std::isfinite(*nominal.dbhz()));
  nominal.reset();
  EXPECT_FALSE(nominal.dbhz());
}

}  // namespace
}  // namespace urban_gnss
