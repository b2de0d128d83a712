#include <gtest/gtest.h>

#include <Eigen/Dense>

#include "random_gaussian.hpp"

namespace urban_gnss {
namespace {

/// F P F' + Q with the whole matrices.
BiasEkfCovariance predicted_covariance(const BiasGaussian& state, const MotionStep& motion,
                                       const OdometryErrorParameters& p) {
  const DeadReckoningStep step = dead_reckon(state.pose(), {state.mean[3], state.mean[4], state.mean[5]}, motion, p);
  BiasEkfCovariance f = BiasEkfCovariance::Identity();
  f.topLeftCorner<kErrorStates, kErrorStates>() = step.transition;
  f.block<3, 1>(0, kErrorStates) = step.yaw_rate_scale;
  BiasEkfCovariance q = BiasEkfCovariance::Zero();
  q.topLeftCorner<kErrorStates, kErrorStates>() = step.noise;
  return f * state.covariance * f.transpose() + q;
}

TEST(BiasEkf, PredictionIsThatOfTheWholeMatrices) {
  RandomEngine engine = make_engine(5);
  const OdometryErrorParameters p;
  for (const Twist2& twist : {Twist2{1.5, 0.4}, Twist2{-12.0, -1.1, 0.3}, Twist2{0.0, 0.0}}) {
    const MotionStep motion = make_motion_step(twist, 0.2, MotionParameters(), p);
    BiasGaussian state = random_gaussian(engine);
    const BiasEkfCovariance expected = predicted_covariance(state, motion, p);
    predict(state, motion, p);
    EXPECT_LT((state.covariance - expected).cwiseAbs().maxCoeff(), 1e-12 * expected.cwiseAbs().maxCoeff());
  }
}

TEST(BiasEkf, MeansOfAMixtureAreThoseOfItsMoments) {
  RandomEngine engine = make_engine(6);
  std::array<BiasGaussian, 3> parts{random_gaussian(engine), random_gaussian(engine), random_gaussian(engine)};
  parts[0].mean[2] = 3.1;
  parts[1].mean[2] = -3.1;
  const double weights[] = {0.5, 0.3, 0.2};
  const auto state_of = [&](std::size_t i) -> const BiasGaussian& { return parts[i]; };
  const auto weight_of = [&](std::size_t i) { return weights[i]; };
  const BiasGaussian whole = match_moments(3, state_of, weight_of);
  BiasEkfState mean = BiasEkfState::Zero();
  BiasEkfCovariance square = BiasEkfCovariance::Zero();
  for (std::size_t i = 0; i < 3; ++i) {
    const BiasEkfState apart = difference(parts[i].mean, parts[0].mean);
    mean += weights[i] * apart;
    square += weights[i] * (parts[i].covariance + apart * apart.transpose());
  }
  EXPECT_LT(difference(whole.mean, parts[0].mean + mean).norm(), 1e-12);
  EXPECT_LT((whole.covariance - (square - mean * mean.transpose())).cwiseAbs().maxCoeff(), 1e-12);
}

}  // namespace
}  // namespace urban_gnss
