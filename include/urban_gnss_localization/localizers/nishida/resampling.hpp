#pragma once

#include <cstdint>
#include <vector>

#include "urban_gnss_localization/common/parameters.hpp"
#include "urban_gnss_localization/localizers/particle_set.hpp"

namespace urban_gnss {

enum class ResamplingScheme {
  kMultinomial,  ///< eq. (40): independent draws
  kSystematic,   ///< one draw, then equal steps: less variance
};
EnumNames<ResamplingScheme> enum_names(ResamplingScheme);

/// Draws particles by their weights, eq. (40), and sets the weights equal, eq. (41). Both schemes are O(N) and allocate
/// nothing after construction.
class Resampler {
 public:
  Resampler(std::size_t particle_count, ResamplingScheme scheme);

  /// Requires normalised weights.
  void resample(ParticleSet& particles, RandomEngine& engine);

  /// Gives numbers that stand beside the poses the parents of the last call of resample().
  void gather(std::vector<double>& values);

  /// Which old particle each new one is a copy of, ascending: of the last call.
  const std::vector<std::uint32_t>& parents() const { return parents_; }

 private:
  void draw_multinomial(const std::vector<double>& weight, RandomEngine& engine);
  void draw_systematic(const std::vector<double>& weight, RandomEngine& engine);

  ResamplingScheme scheme_;
  std::vector<std::uint32_t> parents_;
  std::vector<double> scratch_;
};

}  // namespace urban_gnss
