#include "urban_gnss_localization/common/parameters.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

namespace urban_gnss {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

struct Inner {
  double low{1.0};
  double high{2.0};

  void visit(ParameterVisitor& v) {
    v("low", low, positive(), "m", "the least");
    v("high", high, positive(), "m", "the most");
  }
  void check(std::vector<std::string>& faults) const {
    if (low > high) faults.push_back("low: must be at most high");
  }
};

struct Outer {
  int count{3};
  std::vector<double> offset{0.0, 0.0};
  Inner inner;

  void visit(ParameterVisitor& v) {
    v.basic()("count", count, at_least(1), "", "of things");
    v("offset", offset, "m", "of the antenna");
    v.group("inner", inner, "within");
  }
};

TEST(Parameters, DefaultsHaveNoFault) { EXPECT_THAT(faults_of(Outer()), IsEmpty()); }

TEST(Parameters, EveryFaultIsFound) {
  Outer outer;
  outer.count = 0;
  outer.offset[1] = std::numeric_limits<double>::quiet_NaN();
  outer.inner.low = -1.0;
  EXPECT_THAT(faults_of(outer), ElementsAre("count = 0: must be a finite number of at least 1",
                                            "offset: must be finite numbers",
                                            "low = -1: must be a finite number greater than 0"));
}

/// A condition of a struct within is checked without a word of the struct around it.
TEST(Parameters, ConditionsOfStructsWithinAreChecked) {
  Outer outer;
  outer.inner.low = 3.0;
  EXPECT_THAT(faults_of(outer), ElementsAre("low: must be at most high"));
  EXPECT_THROW(require_usable("outer", outer), ParameterError);
}

TEST(Parameters, RangesSayWhatIsInThem) {
  EXPECT_TRUE(between(0.0, 1.0).contains(0.0));
  EXPECT_FALSE(open_between(0.0, 1.0).contains(0.0));
  EXPECT_TRUE(open_between(0.0, 1.0).contains(1.0));
  EXPECT_FALSE(positive().contains(0.0));
  EXPECT_TRUE(at_least(2.0).contains(2.0));
  EXPECT_FALSE(any_number().contains(std::numeric_limits<double>::infinity()));
  EXPECT_FALSE(any_number().contains(std::numeric_limits<double>::quiet_NaN()));
}

}  // namespace
}  // namespace urban_gnss
