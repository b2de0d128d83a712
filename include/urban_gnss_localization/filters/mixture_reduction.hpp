#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "urban_gnss_localization/common/random.hpp"
#include "urban_gnss_localization/filters/bias_ekf.hpp"

namespace urban_gnss {

/// One hypothesis of the switching bias: the state given its modes.
struct BiasHypothesis {
  BiasGaussian state;
  BiasMode mode{BiasMode::kDirect};  ///< at the last fix; lasts
  double weight{0.0};
};

/// How different two states are: Bhattacharyya distance of their marginals, summed. States that are certain in both
/// count for nothing.
double marginal_distance(const BiasGaussian& a, const BiasGaussian& b);

/// The c with sum of min(1, w / c) = `most`, for weights in descending order that sum to 1; 0 where there are no more
/// than `most` > 0.
double selection_threshold(const std::vector<double>& descending, std::size_t most);

/// Makes a mixture of hypotheses smaller without changing what it says on average.
///
/// Hypotheses of the same mode whose states are nearly the same, as those are whose histories differ long ago alone,
/// become one with their moments. Of what is left, those with a weight above a threshold c stay as they are, and one
/// of a smaller weight w survives with probability w / c and then has the weight c, by systematic draws (Fearnhead and
/// Clifford 2003). c is such that no more than `most` are left, and at least kNegligible: so few are left where few are
/// plausible. Allocates nothing after construction.
class MixtureReducer {
 public:
  static constexpr double kNegligible = 1e-4;
  static constexpr double kSame = 0.05;

  /// For up to `most_before` hypotheses.
  explicit MixtureReducer(std::size_t most_before);

  /// Weights must sum to 1, and do so afterwards; the order becomes that of the weights before the draws.
  void reduce(std::vector<BiasHypothesis>& hypotheses, std::size_t most, RandomEngine& engine);

 private:
  void merge(std::vector<BiasHypothesis>& hypotheses);
  void select(std::vector<BiasHypothesis>& hypotheses, std::size_t most, RandomEngine& engine);
  void sort(const std::vector<BiasHypothesis>& hypotheses);

  std::vector<std::uint32_t> order_;  ///< by weight
  std::vector<std::uint32_t> kept_;
  std::vector<double> weights_;
  std::vector<BiasHypothesis> scratch_;
};

}  // namespace urban_gnss
