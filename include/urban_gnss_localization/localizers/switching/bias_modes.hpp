#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <string>
#include <vector>

#include "urban_gnss_localization/common/parameters.hpp"

namespace urban_gnss {

/// How a fix came about. What stands before kJump can last; a jump is an entry into kSlow.
enum class BiasMode : std::size_t {
  kDirect,  ///< S: no bias
  kSlow,    ///< L: a bias that changes slowly
  kFast,    ///< F: a bias that changes fast
  kJump,    ///< J: a new slow bias that came at once, since the fix before
};
inline constexpr std::size_t kLastingModes = 3;
inline constexpr std::size_t kContinuations = 4;

constexpr std::size_t index_of(BiasMode mode) { return static_cast<std::size_t>(mode); }
/// The mode that a fix's mode is at the next one: a jump has become a slow bias.
constexpr BiasMode lasting(BiasMode mode) { return mode == BiasMode::kJump ? BiasMode::kSlow : mode; }

/// The model of a switching bias. Times are means of exponentially distributed ones.
struct BiasModeParameters {
  double direct_time{1000.0};
  double slow_bias_time{20.0};
  double fast_bias_time{1.0};
  double bias_end_time{4.0};
  double jump_share{0.9};
  double slow_bias_walk{0.3};
  double fast_bias_walk{1.0};
  double jump_sigma{20.0};
  double bias_fade_time{20.0};
  double onset_sigma{0.5};
  double student_dof{1.4};
  double outlier_share{0.01};
  double outlier_radius{200.0};

  void visit(ParameterVisitor& v) {
    v("direct_time", direct_time, positive(), "s", "mean time tau_S of direct reception until the next bias");
    v("slow_bias_time", slow_bias_time, positive(), "s",
      "mean time tau_L of a slowly changing bias until it changes fast or jumps");
    v("fast_bias_time", fast_bias_time, positive(), "s",
      "mean time tau_F of a fast changing bias until it ends, becomes slow or jumps");
    v("bias_end_time", bias_end_time, positive(), "s", "mean time tau_LS of a slowly changing bias until it ends");
    v("jump_share", jump_share, between(0.0, 1.0), "", "share p_J of the onsets and changes of a bias that are jumps");
    v("slow_bias_walk", slow_bias_walk, non_negative(), "m/sqrt(s) per axis",
      "random walk of a slowly changing bias, root of q_s");
    v("fast_bias_walk", fast_bias_walk, non_negative(), "m/sqrt(s) per axis",
      "random walk of a fast changing bias, root of q_f");
    v("jump_sigma", jump_sigma, positive(), "m per axis", "standard deviation sigma_J of a bias after a jump");
    v("bias_fade_time", bias_fade_time, non_negative(), "s",
      "time constant at which a bias is forgotten, its mean decaying to 0 and its spread growing to jump_sigma; 0: "
      "never");
    v("onset_sigma", onset_sigma, non_negative(), "m per axis",
      "standard deviation of a bias that begins without a jump");
    v("student_dof", student_dof, positive(), "",
      "degrees of freedom of Student's t noise of a fix in direct reception; large: Gaussian");
    v("outlier_share", outlier_share, between(0.0, 0.5), "",
      "share of fixes that are outliers and carry no information");
    v("outlier_radius", outlier_radius, positive(), "m", "radius within which an outlier may lie anywhere");
  }

  /// Share of the fixes times the density of what is anywhere: a fix's likelihood is at least this (1/m^2).
  double outlier_density() const;
};

/// Row: the mode at the last fix; column: the mode at this one.
using ModeTransition = Eigen::Matrix<double, kLastingModes, kContinuations>;
using ModeProbabilities = Eigen::Matrix<double, kLastingModes, 1>;

/// Probabilities of the mode at a fix `elapsed_s` >= 0 after the last, given the mode then: the matrix exponential of
/// the rates. Every row is positive or 0 and sums to 1, for any time.
///
/// `bias_odds` > 0 multiplies the odds of a bias against direct reception in the long run: what satellites, map or C/N0
/// say beforehand. Onsets become more, ends less frequent by its root, whatever the rate of fixes.
ModeTransition mode_transition(double elapsed_s, const BiasModeParameters& parameters, double bias_odds = 1.0);

/// Shares of time in each mode in the long run.
ModeProbabilities stationary_modes(const BiasModeParameters& parameters, double bias_odds = 1.0);

/// How a bias goes on from the last fix to the next.
struct BiasStep {
  double left{0.0};       ///< share of it that is left
  double growth_m2{0.0};  ///< variance per axis that comes to it
};
/// From the lasting mode (first index) to a mode of the next fix.
using BiasSteps = std::array<std::array<BiasStep, kContinuations>, kLastingModes>;
/// Steps over `elapsed_s` >= 0. A bias that goes on is a first-order Markov process, whose stationary standard
/// deviation is jump_sigma.
BiasSteps bias_steps(double elapsed_s, const BiasModeParameters& parameters);

}  // namespace urban_gnss
