#include "pipeline_rig.hpp"
#include "urban_gnss_localization/pipeline/map_datum.hpp"

namespace urban_gnss {
namespace {

const GeodeticPosition kElsewhere{34.0, 131.0, 5.0};

DatumParameters given() {
  DatumParameters parameters;
  parameters.datum = {kDatum.latitude_deg, kDatum.longitude_deg, kDatum.altitude_m};
  return parameters;
}

void add_fixes(MapDatum& datum) {
  for (int k = 1; k <= 5; ++k) datum.add(raw_fix(from_seconds(k), {0.1 * k, 0.0}));
}

TEST(MapDatum, ParametersDatumIsThereFromTheStartAndAfterAReset) {
  MapDatum datum(given());
  ASSERT_TRUE(datum.frame());
  EXPECT_EQ(datum.describe(), "datum from parameter: latitude 33, longitude 130, altitude 20 m");
  datum.reset();
  ASSERT_TRUE(datum.frame());
  EXPECT_TRUE(datum.frame()->datum() == kDatum);
}

TEST(MapDatum, ComesFromAgreeingFixesAndSurvivesAReset) {
  MapDatum datum({});
  EXPECT_FALSE(datum.frame());
  EXPECT_EQ(datum.waiting_for(), "0 of 5 agreeing fixes");
  add_fixes(datum);
  ASSERT_TRUE(datum.frame());
  EXPECT_NE(datum.describe().find("datum from 5 agreeing fixes"), std::string::npos) << datum.describe();
  EXPECT_LT(datum.frame()->to_local(raw_fix({}, {0.3, 0.0}).position).head<2>().norm(), 1e-6);
  const GeodeticPosition found = datum.frame()->datum();
  datum.reset();
  ASSERT_TRUE(datum.frame());
  EXPECT_TRUE(datum.frame()->datum() == found);
}

TEST(MapDatum, OneThatIsSetStays) {
  MapDatum datum(given());
  EXPECT_FALSE(datum.set(kDatum)) << "the same as before";
  EXPECT_TRUE(datum.set(kElsewhere));
  add_fixes(datum);
  EXPECT_TRUE(datum.frame()->datum() == kElsewhere);
  datum.reset();
  EXPECT_TRUE(datum.frame()->datum() == kElsewhere);
  EXPECT_NE(datum.describe().find("datum from request: latitude 34"), std::string::npos) << datum.describe();
}

TEST(MapDatum, ImpossiblePlaceChangesNothing) {
  MapDatum datum({});
  EXPECT_THROW(datum.set({91.0, 0.0, 0.0}), std::invalid_argument);
  EXPECT_FALSE(datum.frame());
  add_fixes(datum);
  EXPECT_THROW(datum.set({kNaN, 0.0, 0.0}), std::invalid_argument);
  EXPECT_TRUE(datum.frame());
}

}  // namespace
}  // namespace urban_gnss
