#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "urban_gnss_localization/common/progress.hpp"

namespace urban_gnss {
namespace {

using testing::HasSubstr;

std::string said(Progress progress, std::size_t done) {
  testing::internal::CaptureStderr();
  progress.report(done, "now");
  return testing::internal::GetCapturedStderr();
}

TEST(Progress, PiecesWithoutANameAreShownInPercent) {
  EXPECT_THAT(said(Progress(1000), 374), HasSubstr("37.4 %  now"));
  EXPECT_THAT(said(Progress(3), 3), HasSubstr("100.0 %  now"));
}

TEST(Progress, PiecesWithANameAreCounted) { EXPECT_THAT(said(Progress(30, "runs"), 12), HasSubstr("12/30 runs  now")); }

}  // namespace
}  // namespace urban_gnss
