#include "urban_gnss_localization/localizers/switching/bias_modes.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <unsupported/Eigen/MatrixFunctions>

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

void normalise_rows(Rates& probabilities) {
  probabilities = probabilities.cwiseMax(0.0);
  for (Eigen::Index row = 0; row < probabilities.rows(); ++row) probabilities.row(row) /= probabilities.row(row).sum();
}

/// exp(rates t), whose rows are probabilities to rounding: they are made so exactly.
Rates transition_of(const Rates& rates, double time_s) {
  Rates result = (rates * time_s).exp();
  normalise_rows(result);
  return result;
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

double bias_fade(double elapsed_s, const BiasModeParameters& p) {
  return p.bias_fade_time > 0.0 ? std::exp(-elapsed_s / p.bias_fade_time) : 1.0;
}

double bias_growth(BiasMode to, double elapsed_s, const BiasModeParameters& p) {
  if (to != BiasMode::kSlow && to != BiasMode::kFast) return 0.0;
  const double walk = to == BiasMode::kSlow ? p.slow_bias_walk : p.fast_bias_walk;
  const double fade = bias_fade(elapsed_s, p);
  return walk * walk * elapsed_s + (1.0 - fade * fade) * p.jump_sigma * p.jump_sigma;
}

BiasState predict_bias(const BiasState& bias, BiasMode from, BiasMode to, double elapsed_s,
                       const BiasModeParameters& p) {
  BiasState predicted;
  if (to == BiasMode::kDirect) return predicted;
  if (to == BiasMode::kJump) {
    predicted.variance = p.jump_sigma * p.jump_sigma;
  } else if (from == BiasMode::kDirect) {
    predicted.variance = p.onset_sigma * p.onset_sigma + bias_growth(to, elapsed_s, p);
  } else {
    const double fade = bias_fade(elapsed_s, p);
    predicted.mean = fade * bias.mean;
    predicted.variance = fade * fade * bias.variance + bias_growth(to, elapsed_s, p);
  }
  return predicted;
}

}  // namespace urban_gnss
