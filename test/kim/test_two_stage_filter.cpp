#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>

#include "matchers.hpp"
#include "urban_gnss_localization/localizers/kim/two_stage_filter.hpp"

namespace urban_gnss {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using DynamicFilter = TwoStageFilter<Eigen::Dynamic, Eigen::Dynamic, Eigen::Dynamic>;

MatrixXd random_matrix(Eigen::Index rows, Eigen::Index columns, RandomEngine& engine) {
  MatrixXd matrix(rows, columns);
  for (Eigen::Index i = 0; i < matrix.size(); ++i) matrix.data()[i] = draw_normal(engine);
  return matrix;
}

/// Positive definite, with eigenvalues of at least 0.1.
MatrixXd random_covariance(Eigen::Index size, RandomEngine& engine) {
  const MatrixXd root = random_matrix(size, size, engine);
  return root * root.transpose() / static_cast<double>(size) + 0.1 * MatrixXd::Identity(size, size);
}

/// Neither grows nor vanishes in 200 steps: a rotation-like matrix of norm 0.99.
MatrixXd random_transition(Eigen::Index size, RandomEngine& engine) {
  const Eigen::HouseholderQR<MatrixXd> qr(random_matrix(size, size, engine));
  return 0.99 * MatrixXd(qr.householderQ());
}

/// The Kalman filter of (x, b), written without reference to the two stages.
struct AugmentedFilter {
  VectorXd state;
  MatrixXd covariance;

  void predict(const MatrixXd& f, const MatrixXd& b, const MatrixXd& q, const MatrixXd& q_b) {
    const Eigen::Index n = f.rows();
    const Eigen::Index d = b.cols();
    MatrixXd transition = MatrixXd::Identity(n + d, n + d);
    transition.topLeftCorner(n, n) = f;
    transition.topRightCorner(n, d) = b;
    state = transition * state;
    covariance = transition * covariance * transition.transpose();
    covariance.topLeftCorner(n, n) += q;
    covariance.bottomRightCorner(d, d) += q_b;
  }
  void correct(const VectorXd& z, const MatrixXd& h, const MatrixXd& c, const MatrixXd& r) {
    MatrixXd observation(z.size(), state.size());
    observation << h, c;
    const MatrixXd s = observation * covariance * observation.transpose() + r;
    const MatrixXd gain = covariance * observation.transpose() * s.inverse();
    state += gain * (z - observation * state);
    const MatrixXd left = MatrixXd::Identity(state.size(), state.size()) - gain * observation;
    covariance = left * covariance * left.transpose() + gain * r * gain.transpose();
  }
};

/// The farthest that the two-stage filter is from the augmented one in any number of any of 200 steps. The innovation
/// of the first has no knowledge of the second.
double largest_difference(RandomEngine& engine, bool bias_walks) {
  const auto size = [&](int most) { return 1 + static_cast<Eigen::Index>(draw_uniform(engine) * most); };
  const Eigen::Index n = size(5);
  const Eigen::Index d = size(3);
  const Eigen::Index m = size(3);
  const VectorXd x0 = random_matrix(n, 1, engine);
  const MatrixXd p0 = random_covariance(n, engine);
  const MatrixXd m0 = random_covariance(d, engine);
  const MatrixXd q_b = bias_walks ? MatrixXd(0.05 * random_covariance(d, engine)) : MatrixXd::Zero(d, d);

  DynamicFilter two_stage(x0, p0, d);
  two_stage.open_bias(m0);
  AugmentedFilter augmented{VectorXd::Zero(n + d), MatrixXd::Zero(n + d, n + d)};
  augmented.state.head(n) = x0;
  augmented.covariance.topLeftCorner(n, n) = p0;
  augmented.covariance.bottomRightCorner(d, d) = m0;

  double worst = 0.0;
  for (int step = 0; step < 200; ++step) {
    const MatrixXd f = random_transition(n, engine);
    const MatrixXd b = random_matrix(n, d, engine);
    const MatrixXd q = random_covariance(n, engine);
    two_stage.predict(f * two_stage.bias_free_state(), f, q, b);
    if (bias_walks) two_stage.grow_bias(q_b);
    augmented.predict(f, b, q, q_b);

    const MatrixXd h = random_matrix(m, n, engine);
    const MatrixXd c = random_matrix(m, d, engine);
    const MatrixXd r = random_covariance(m, engine);
    const VectorXd z = 10.0 * random_matrix(m, 1, engine);
    const VectorXd innovation = z - h * two_stage.bias_free_state();
    MatrixXd observation(m, n + d);
    observation << h, c;
    worst = std::max(
        {worst,
         (two_stage.innovation_covariance(h, c, r) - observation * augmented.covariance * observation.transpose() - r)
             .cwiseAbs()
             .maxCoeff(),
         (two_stage.compensated_innovation(innovation, h, c) - (z - observation * augmented.state))
             .cwiseAbs()
             .maxCoeff()});
    two_stage.correct(innovation, h, c, r);
    augmented.correct(z, h, c, r);

    worst =
        std::max({worst, (two_stage.compensated_state() - augmented.state.head(n)).cwiseAbs().maxCoeff(),
                  (two_stage.bias() - augmented.state.tail(d)).cwiseAbs().maxCoeff(),
                  (two_stage.compensated_covariance() - augmented.covariance.topLeftCorner(n, n)).cwiseAbs().maxCoeff(),
                  (two_stage.bias_covariance() - augmented.covariance.bottomRightCorner(d, d)).cwiseAbs().maxCoeff(),
                  (two_stage.cross_covariance() - augmented.covariance.topRightCorner(n, d)).cwiseAbs().maxCoeff()});
  }
  return worst;
}

TEST(TwoStageFilter, EqualsTheAugmentedFilterForAConstantBias) {
  RandomEngine engine = make_engine(1);
  double worst = 0.0;
  for (int system = 0; system < 100; ++system) worst = std::max(worst, largest_difference(engine, false));
  RecordProperty("largest_difference", std::to_string(worst * 1e15) + "e-15");
  EXPECT_LT(worst, 1e-9);
}

TEST(TwoStageFilter, EqualsTheAugmentedFilterForABiasThatWalks) {
  RandomEngine engine = make_engine(2);
  double worst = 0.0;
  for (int system = 0; system < 100; ++system) worst = std::max(worst, largest_difference(engine, true));
  EXPECT_LT(worst, 1e-9);
}

using FixedFilter = TwoStageFilter<3, 2, 2>;

FixedFilter some_filter() {
  FixedFilter::StateCovariance p;
  p << 2.0, 0.3, 0.1, 0.3, 1.0, -0.2, 0.1, -0.2, 0.5;
  return FixedFilter({1.0, -2.0, 0.5}, p);
}

const FixedFilter::Observation kPosition = FixedFilter::Observation::Identity();
const FixedFilter::BiasObservation kDirect = FixedFilter::BiasObservation::Identity();
const Eigen::Matrix2d kNoise = Eigen::Vector2d(0.8, 1.5).asDiagonal();

// The gain as step B.5 prints it: M (V' H' + C') R^-1 with the updated M and V.
TEST(TwoStageFilter, BiasGainIsThePrintedOne) {
  FixedFilter filter = some_filter();
  filter.open_bias(9.0 * Eigen::Matrix2d::Identity());
  const Eigen::Vector2d innovation(3.0, -1.0);
  const Eigen::Vector2d before = filter.bias();
  filter.correct(innovation, kPosition, kDirect, kNoise);
  const Eigen::Matrix2d printed = filter.bias_covariance() *
                                  (filter.blending().transpose() * kPosition.transpose() + kDirect.transpose()) *
                                  kNoise.inverse();
  const Eigen::Matrix2d t = kDirect;  // V was zero
  const Eigen::Vector2d expected = (Eigen::Matrix2d::Identity() - printed * t) * before + printed * innovation;
  EXPECT_LT((filter.bias() - expected).norm(), 1e-12);
}

// Without a bias stage nothing may be left of it.
TEST(TwoStageFilter, ClosedItIsTheBiasFreeFilter) {
  FixedFilter filter = some_filter();
  FixedFilter opened = some_filter();
  opened.open_bias(1e-300 * Eigen::Matrix2d::Identity());
  for (int k = 0; k < 5; ++k) {
    const FixedFilter::StateCovariance f = FixedFilter::StateCovariance::Identity();
    for (FixedFilter* each : {&filter, &opened}) {
      each->predict(each->bias_free_state(), f, 0.1 * f);
      each->correct(Eigen::Vector2d(0.4, -0.7), kPosition, kDirect, kNoise);
    }
  }
  EXPECT_EQ(filter.bias().norm(), 0.0);
  EXPECT_EQ(filter.bias_covariance().norm(), 0.0);
  EXPECT_LT((filter.compensated_state() - opened.compensated_state()).norm(), 1e-12);
}

// A jump of 20 m at a filter that knows its place: the bias takes it, the state keeps its own.
TEST(TwoStageFilter, OpenedItLeavesAJumpToTheBias) {
  FixedFilter filter({0.0, 0.0, 0.0}, 0.01 * FixedFilter::StateCovariance::Identity());
  filter.open_bias(400.0 * Eigen::Matrix2d::Identity());
  filter.correct(Eigen::Vector2d(20.0, 0.0), kPosition, kDirect, Eigen::Matrix2d::Identity());
  EXPECT_NEAR(filter.bias().x(), 20.0 * 400.0 / 401.01, 1e-9);
  EXPECT_LT(filter.compensated_state().norm(), 1e-3);
}

TEST(TwoStageFilter, ClosingAndReopeningKeepTheEstimate) {
  FixedFilter filter = some_filter();
  filter.open_bias(9.0 * Eigen::Matrix2d::Identity());
  filter.correct(Eigen::Vector2d(3.0, -1.0), kPosition, kDirect, kNoise);
  const FixedFilter::State state = filter.compensated_state();
  const FixedFilter::StateCovariance covariance = filter.compensated_covariance();
  filter.open_bias(Eigen::Matrix2d::Identity());
  EXPECT_LT((filter.compensated_state() - state).norm(), 1e-12);
  EXPECT_LT((filter.compensated_covariance() - covariance).norm(), 1e-12);
  EXPECT_EQ(filter.bias().norm(), 0.0);
  EXPECT_EQ(filter.cross_covariance().norm(), 0.0);
  filter.close_bias();
  EXPECT_LT((filter.bias_free_covariance() - covariance).norm(), 1e-12);
  EXPECT_EQ(filter.bias_covariance().norm(), 0.0);
}

}  // namespace
}  // namespace urban_gnss
