#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <string>
#include <vector>

#include "urban_gnss_localization/common/parameters.hpp"

namespace urban_gnss {

/// What is known of a fix's noise without and with a bias.
struct FixSigmaParameters {
  bool use_fix_covariance{true};  ///< each fix's own covariance in place of direct_sigma
  double direct_sigma{3.0};       ///< m per axis, sigma_b, in direct reception
  double shadow_sigma{3.0};       ///< m per axis, sigma_s, in the shadow, about its bias

  template <class V>
  void visit(V& v) {
    v("use_fix_covariance", use_fix_covariance);
    v("direct_sigma", direct_sigma, positive());
    v("shadow_sigma", shadow_sigma, positive());
  }
  void check(std::vector<std::string>&) const {}

  /// Covariance (m^2) of a fix that declares `declared`, in direct reception.
  Eigen::Matrix2d direct_covariance(const Eigen::Matrix2d& declared) const;
  /// The same about its bias, in the shadow: larger by the ratio of the sigmas where the fix's own covariance is used.
  Eigen::Matrix2d shadow_covariance(const Eigen::Matrix2d& declared) const;
};

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
  double direct_time{1000.0};    ///< s, tau_S: direct reception until the next bias
  double slow_bias_time{20.0};   ///< s, tau_L: a slow bias until it changes fast or jumps
  double fast_bias_time{1.0};    ///< s, tau_F: a fast changing bias until it ends, becomes slow or jumps
  double bias_end_time{5.0};     ///< s, tau_LS: a slow bias until it ends
  double jump_share{0.9};        ///< p_J: of the onsets and changes, those that come at once
  double slow_bias_walk{0.3};    ///< m/sqrt(s) per axis, sqrt(q_s)
  double fast_bias_walk{1.0};    ///< m/sqrt(s) per axis, sqrt(q_f)
  double jump_sigma{8.0};        ///< m per axis, sigma_J, of a bias that came at once
  double bias_fade_time{20.0};   ///< s, after which a bias is again like one that has just come; 0: it never forgets
  double onset_sigma{0.5};       ///< m per axis, of a bias that begins without a jump
  double student_dof{4.0};       ///< degrees of freedom of the noise in direct reception; large ones are Gaussian
  double outlier_share{0.01};    ///< of the fixes, those that say nothing
  double outlier_radius{200.0};  ///< m, within which such a fix is anywhere

  template <class V>
  void visit(V& v) {
    v("direct_time", direct_time, positive());
    v("slow_bias_time", slow_bias_time, positive());
    v("fast_bias_time", fast_bias_time, positive());
    v("bias_end_time", bias_end_time, positive());
    v("jump_share", jump_share, between(0.0, 1.0));
    v("slow_bias_walk", slow_bias_walk, non_negative());
    v("fast_bias_walk", fast_bias_walk, non_negative());
    v("jump_sigma", jump_sigma, positive());
    v("bias_fade_time", bias_fade_time, non_negative());
    v("onset_sigma", onset_sigma, non_negative());
    v("student_dof", student_dof, positive());
    v("outlier_share", outlier_share, between(0.0, 0.5));
    v("outlier_radius", outlier_radius, positive());
  }
  void check(std::vector<std::string>&) const {}

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

/// A bias (m): Gaussian with the same variance (m^2) in x and y, independent.
struct BiasState {
  Eigen::Vector2d mean{Eigen::Vector2d::Zero()};
  double variance{0.0};
};

/// What is left after `elapsed_s` >= 0 of a bias that goes on, as a share of it: a bias is a first-order Markov process
/// whose stationary standard deviation is jump_sigma.
double bias_fade(double elapsed_s, const BiasModeParameters& parameters);

/// Variance (m^2 per axis) by which a bias in `to` grows over `elapsed_s` >= 0.
double bias_growth(BiasMode to, double elapsed_s, const BiasModeParameters& parameters);

/// The bias at a fix in mode `to`, from the bias at the last fix in the lasting mode `from`.
BiasState predict_bias(const BiasState& bias, BiasMode from, BiasMode to, double elapsed_s,
                       const BiasModeParameters& parameters);

}  // namespace urban_gnss
