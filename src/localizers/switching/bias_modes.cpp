#include "urban_gnss_localization/localizers/switching/bias_modes.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>

#include "urban_gnss_localization/common/quad.hpp"
#include "urban_gnss_localization/geometry/angles.hpp"

namespace urban_gnss {
namespace {

using Rates = Eigen::Matrix<double, kContinuations, kContinuations>;

constexpr std::size_t kS = index_of(BiasMode::kDirect);
constexpr std::size_t kL = index_of(BiasMode::kSlow);
constexpr std::size_t kF = index_of(BiasMode::kFast);
constexpr std::size_t kJ = index_of(BiasMode::kJump);

/// After so many of the longest time the start is forgotten to rounding.
constexpr double kForgotten = 100.0;

/// 1/s, from row to column. J is a slow bias that has jumped since the last fix: it goes on as L does, and a further
/// jump changes nothing.
Rates mode_rates(const BiasModeParameters& p, double bias_odds) {
  const double more = std::sqrt(bias_odds);
  const double gradual = 1.0 - p.jump_share;
  Rates rates = Rates::Zero();
  rates(kS, kL) = rates(kS, kF) = 0.5 * gradual / p.direct_time * more;
  rates(kS, kJ) = p.jump_share / p.direct_time * more;
  rates(kL, kS) = rates(kJ, kS) = 1.0 / p.bias_end_time / more;
  rates(kL, kF) = rates(kJ, kF) = gradual / p.slow_bias_time;
  rates(kL, kJ) = p.jump_share / p.slow_bias_time;
  rates(kF, kS) = 0.5 * gradual / p.fast_bias_time / more;
  rates(kF, kL) = 0.5 * gradual / p.fast_bias_time;
  rates(kF, kJ) = p.jump_share / p.fast_bias_time;
  rates.diagonal() = -rates.rowwise().sum();
  return rates;
}

/// A matrix of the modes, by rows.
struct ModeRows {
  Quad rows[kContinuations];
  URBAN_GNSS_INLINE Quad& operator[](std::size_t i) { return rows[i]; }
  URBAN_GNSS_INLINE const Quad& operator[](std::size_t i) const { return rows[i]; }
};

URBAN_GNSS_INLINE ModeRows operator*(const ModeRows& a, const ModeRows& b) {
  ModeRows product;
  for (std::size_t i = 0; i < kContinuations; ++i) {
    product[i] = (a[i][0] * b[0] + a[i][1] * b[1]) + (a[i][2] * b[2] + a[i][3] * b[3]);
  }
  return product;
}
/// a A + b B + c I.
URBAN_GNSS_INLINE ModeRows sum(double a, const ModeRows& first, double b, const ModeRows& second, double c) {
  ModeRows sum;
  for (std::size_t i = 0; i < kContinuations; ++i) {
    sum[i] = a * first[i] + b * second[i];
    sum[i][static_cast<int>(i)] += c;
  }
  return sum;
}
URBAN_GNSS_INLINE void add(ModeRows& rows, const ModeRows& added) {
  for (std::size_t i = 0; i < kContinuations; ++i) rows[i] += added[i];
}
URBAN_GNSS_INLINE void normalise(ModeRows& rows) {
  for (Quad& row : rows.rows) row /= sum_of(row);
}

/// exp(rates t), whose rows are probabilities, by uniformization (Jensen 1953): the series of a matrix without a
/// negative number, in which nothing cancels, for a short step, which is then doubled until it is t.
URBAN_GNSS_VECTORISED Rates transition_of(const Rates& rates, double time_s) {
  const double fastest = -rates.diagonal().minCoeff();
  int doublings = 0;
  std::frexp(16.0 * fastest * time_s, &doublings);  // until a step is at most 1/16 of the fastest mean time
  doublings = std::max(doublings, 0);
  const double step_s = std::ldexp(time_s, -doublings);
  ModeRows one;
  for (int i = 0; i < rates.rows(); ++i) {
    for (int j = 0; j < rates.cols(); ++j) one[static_cast<std::size_t>(i)][j] = step_s * rates(i, j);
    one[static_cast<std::size_t>(i)][i] += step_s * fastest;
  }
  // To the eighth power, beyond which nothing is left but rounding, by three powers (Paterson and Stockmeyer 1973).
  const ModeRows two = one * one;
  const ModeRows three = two * one;
  ModeRows result = sum(1.0 / 40320.0, two, 1.0 / 5040.0, one, 1.0 / 720.0) * three;
  add(result, sum(1.0 / 120.0, two, 1.0 / 24.0, one, 1.0 / 6.0));
  result = result * three;
  add(result, sum(0.5, two, 1.0, one, 1.0));
  normalise(result);
  for (; doublings > 0; --doublings) result = result * result;
  normalise(result);
  Rates probabilities;
  for (int i = 0; i < rates.rows(); ++i) {
    for (int j = 0; j < rates.cols(); ++j) probabilities(i, j) = result[static_cast<std::size_t>(i)][j];
  }
  return probabilities;
}

}  // namespace

double BiasModeParameters::outlier_density() const { return outlier_share / (kPi * outlier_radius * outlier_radius); }

ModeTransition mode_transition(double elapsed_s, const BiasModeParameters& p, double bias_odds) {
  const Rates rates = mode_rates(p, bias_odds);
  const double slowest = -1.0 / rates.diagonal().maxCoeff();
  return transition_of(rates, std::min(elapsed_s, kForgotten * slowest)).topRows<kLastingModes>();
}

ModeProbabilities stationary_modes(const BiasModeParameters& p, double bias_odds) {
  const Rates rates = mode_rates(p, bias_odds);
  const Rates late = transition_of(rates, -kForgotten / rates.diagonal().maxCoeff());
  return {late(kS, kS), late(kS, kL) + late(kS, kJ), late(kS, kF)};
}

BiasSteps bias_steps(double elapsed_s, const BiasModeParameters& p) {
  const double left = p.bias_fade_time > 0.0 ? std::exp(-elapsed_s / p.bias_fade_time) : 1.0;
  const double drawn_m2 = (1.0 - left * left) * p.jump_sigma * p.jump_sigma;
  const double slow_m2 = p.slow_bias_walk * p.slow_bias_walk * elapsed_s + drawn_m2;
  const double fast_m2 = p.fast_bias_walk * p.fast_bias_walk * elapsed_s + drawn_m2;
  const double onset_m2 = p.onset_sigma * p.onset_sigma;
  const BiasStep jump{0.0, p.jump_sigma * p.jump_sigma};
  BiasSteps steps{};
  steps[kS] = {BiasStep{}, BiasStep{0.0, onset_m2 + slow_m2}, BiasStep{0.0, onset_m2 + fast_m2}, jump};
  steps[kL] = steps[kF] = {BiasStep{}, BiasStep{left, slow_m2}, BiasStep{left, fast_m2}, jump};
  return steps;
}

}  // namespace urban_gnss
