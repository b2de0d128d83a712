#pragma once

#include <cstdint>
#include <vector>

#include "urban_gnss_localization/common/counter_random.hpp"
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
  void resample(ParticleSet& particles, const RandomStream& stream);

  /// Which old particle each new one is a copy of, ascending: of the last call.
  const std::vector<std::uint32_t>& parents() const { return parents_; }

 private:
  void draw_multinomial(const std::vector<float>& weight, const RandomStream& stream);
  void draw_systematic(const std::vector<float>& weight, const RandomStream& stream);

  ResamplingScheme scheme_;
  std::vector<std::uint32_t> parents_;
  std::vector<float> scratch_;
};

}  // namespace urban_gnss
