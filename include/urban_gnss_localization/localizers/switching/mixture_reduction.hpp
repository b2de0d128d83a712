#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "urban_gnss_localization/common/random.hpp"
#include "urban_gnss_localization/localizers/switching/bias_ekf.hpp"

namespace urban_gnss {

/// One hypothesis of the switching bias: the state given its modes and the quality of the odometry.
struct BiasHypothesis {
  BiasGaussian state;
  BiasMode mode{BiasMode::kDirect};
  std::size_t quality{0};  ///< level of the odometry, below kQualityLevels
  double weight{0.0};
};

/// How different two states are: the sum of the Bhattacharyya distances of their marginals. Components that are certain
/// in both are left out.
double marginal_distance(const BiasGaussian& a, const BiasGaussian& b);

/// The c with sum of min(1, w / c) = `most`, for weights in descending order that sum to 1; 0 where there are no more
/// than `most` > 0.
double selection_threshold(const std::vector<double>& descending, std::size_t most);

/// Makes a mixture of hypotheses smaller without changing what it says on average. Allocates nothing after
/// construction.
class MixtureReducer {
 public:
  static constexpr double kNegligible = 1e-4;
  /// rad: headings farther apart are never merged, as no extended Kalman filter is good for both.
  static constexpr double kSameHeading = 0.1;

  /// For up to `most_before` hypotheses.
  explicit MixtureReducer(std::size_t most_before);

  /// Those of the same mode and quality whose marginal_distance() to a heavier one is less than `distance`, as it is
  /// where their histories differ long ago alone, become one with it, with their moments. Leaves them in the order of
  /// the weights they had.
  void merge(std::vector<BiasHypothesis>& hypotheses, double distance);

  /// Those with a weight above a threshold c stay as they are; one of a smaller weight w survives with probability
  /// w / c and then has the weight c, by systematic draws (Fearnhead and Clifford 2003). c is such that no more than
  /// `most` (and one, by rounding) are left, and at least kNegligible: so few are left where few are plausible. Weights
  /// must sum to 1, and do so afterwards. Leaves them in the order of the weights they had.
  void select(std::vector<BiasHypothesis>& hypotheses, std::size_t most, RandomEngine& engine);

 private:
  void sort(const std::vector<BiasHypothesis>& hypotheses);

  std::vector<std::uint32_t> order_;  ///< by weight
  std::vector<std::uint32_t> kept_;
  std::vector<double> weights_;
  std::vector<BiasHypothesis> scratch_;
};

}  // namespace urban_gnss
