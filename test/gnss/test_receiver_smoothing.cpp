#include <gtest/gtest.h>

#include <cmath>

#include "urban_gnss_localization/common/random.hpp"
#include "urban_gnss_localization/gnss/receiver_smoothing.hpp"

namespace urban_gnss {
namespace {

Eigen::Matrix2d diagonal(double east, double north) { return Eigen::Vector2d(east, north).asDiagonal(); }

Stamp seconds(double s) { return from_seconds(s); }

const Eigen::Vector2d kNone(0.0, 0.0);

TEST(ReceiverSmoothing, FadesWithTheSmoothingTime) {
  ReceiverSmoothingParameters p;
  p.receiver_smoothing_time = 5.0;
  ReceiverSmoothing smoothing(p);
  EXPECT_TRUE(smoothing.add(seconds(0.0), kNone, diagonal(100.0, 36.0)).isApprox(diagonal(100.0, 36.0), 1e-12));
  Eigen::Matrix2d last;
  for (int k = 1; k <= 50; ++k) last = smoothing.add(seconds(0.2 * k), kNone, diagonal(1.0, 1.0));
  const double kept = std::exp(-10.0 / 5.0);
  EXPECT_TRUE(last.isApprox(diagonal(std::pow(1.0 + 9.0 * kept, 2), std::pow(1.0 + 5.0 * kept, 2)), 1e-9));
}

TEST(ReceiverSmoothing, DoesNotDependOnTheRateWhereTheSolutionStays) {
  ReceiverSmoothing fast((ReceiverSmoothingParameters()));
  ReceiverSmoothing slow((ReceiverSmoothingParameters()));
  Eigen::Matrix2d turned;
  turned << 4.0, 1.5, 1.5, 2.0;
  for (ReceiverSmoothing* each : {&fast, &slow}) each->add(seconds(0.0), {3.0, -4.0}, diagonal(50.0, 9.0));
  for (int k = 1; k < 20; ++k) fast.add(seconds(0.1 * k), {1.0, 0.0}, turned);
  EXPECT_TRUE(fast.add(seconds(2.0), {1.0, 0.0}, turned).isApprox(slow.add(seconds(2.0), {1.0, 0.0}, turned), 1e-9));
}

TEST(ReceiverSmoothing, MeansOfOppositeSignCancel) {
  ReceiverSmoothingParameters p;
  p.receiver_smoothing_time = 1.0;
  ReceiverSmoothing smoothing(p);
  smoothing.add(seconds(0.0), {10.0, 0.0}, diagonal(0.0, 0.0));
  const double kept = 0.5;
  const Eigen::Matrix2d result = smoothing.add(seconds(std::log(1.0 / kept)), {-10.0, 4.0}, diagonal(0.0, 0.0));
  EXPECT_TRUE(result.isApprox(diagonal(0.0, 4.0), 1e-6));
}

// Against the low-pass itself, run on random errors: those that stay have the spread that the smoothing says, white
// ones less.
TEST(ReceiverSmoothing, IsTheSpreadOfErrorsThatStayAndAnUpperBoundForWhiteOnes) {
  const ReceiverSmoothingParameters p;
  const double kept = std::exp(-0.2 / p.receiver_smoothing_time);
  const int kSteps = 60;
  const auto sigma = [](int k) { return k < 30 ? 12.0 : 2.0; };
  const auto mean = [](int k) { return k < 20 ? 5.0 : -1.0; };
  ReceiverSmoothing smoothing(p);
  double said = 0.0;
  for (int k = 0; k < kSteps; ++k) {
    said = smoothing.add(seconds(0.2 * k), {mean(k), 0.0}, diagonal(sigma(k) * sigma(k), 1.0))(0, 0);
  }
  RandomEngine engine = make_engine(3);
  double of_staying = 0.0;
  double of_white = 0.0;
  const int kRuns = 20000;
  for (int run = 0; run < kRuns; ++run) {
    const double draw = draw_normal(engine);
    double staying = 0.0;
    double white = 0.0;
    for (int k = 0; k < kSteps; ++k) {
      const double a = k == 0 ? 0.0 : kept;
      staying = a * staying + (1.0 - a) * (mean(k) + sigma(k) * draw);
      white = a * white + (1.0 - a) * (mean(k) + sigma(k) * draw_normal(engine));
    }
    of_staying += staying * staying / kRuns;
    of_white += white * white / kRuns;
  }
  EXPECT_NEAR(of_staying, said, 0.03 * said);
  EXPECT_LT(of_white, 0.8 * said);
}

TEST(ReceiverSmoothing, StartsAnewAfterAGapAStampOfThePastAndAReset) {
  ReceiverSmoothing smoothing((ReceiverSmoothingParameters()));
  const Eigen::Matrix2d bad = diagonal(400.0, 400.0);
  const Eigen::Matrix2d good = diagonal(1.0, 1.0);
  smoothing.add(seconds(10.0), kNone, bad);
  EXPECT_GT(smoothing.add(seconds(13.0), kNone, good)(0, 0), 2.0);
  smoothing.add(seconds(14.0), kNone, bad);
  EXPECT_TRUE(smoothing.add(seconds(17.1), kNone, good).isApprox(good, 1e-12));
  smoothing.add(seconds(18.0), kNone, bad);
  EXPECT_TRUE(smoothing.add(seconds(17.9), kNone, good).isApprox(good, 1e-12));
  smoothing.add(seconds(18.0), kNone, bad);
  EXPECT_TRUE(smoothing.add(seconds(18.0), kNone, good).isApprox(good, 1e-12));
  smoothing.add(seconds(18.05), kNone, bad);
  smoothing.reset();
  EXPECT_TRUE(smoothing.add(seconds(18.1), kNone, good).isApprox(good, 1e-12));
}

TEST(ReceiverSmoothing, WithoutSmoothingThereIsNone) {
  ReceiverSmoothingParameters p;
  p.receiver_smoothing_time = 0.0;
  ReceiverSmoothing smoothing(p);
  smoothing.add(seconds(0.0), kNone, diagonal(400.0, 400.0));
  EXPECT_TRUE(smoothing.add(seconds(0.2), kNone, diagonal(1.0, 2.0)).isApprox(diagonal(1.0, 2.0), 1e-12));
}

}  // namespace
}  // namespace urban_gnss
