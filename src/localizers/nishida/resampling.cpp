#include "urban_gnss_localization/localizers/nishida/resampling.hpp"

#include <cmath>

namespace urban_gnss {

EnumNames<ResamplingScheme> enum_names(ResamplingScheme) {
  return {{"multinomial", ResamplingScheme::kMultinomial}, {"systematic", ResamplingScheme::kSystematic}};
}

Resampler::Resampler(std::size_t particle_count, ResamplingScheme scheme)
    : scheme_(scheme), parents_(particle_count), scratch_(particle_count) {}

void Resampler::resample(ParticleSet& particles, RandomEngine& engine) {
  if (scheme_ == ResamplingScheme::kMultinomial) {
    draw_multinomial(particles.weight, engine);
  } else {
    draw_systematic(particles.weight, engine);
  }
  for (std::vector<double>* values : {&particles.x, &particles.y, &particles.yaw}) gather(*values);
  particles.set_equal_weights();
}

void Resampler::gather(std::vector<double>& values) {
  for (std::size_t i = 0; i < parents_.size(); ++i) scratch_[i] = values[parents_[i]];
  values.swap(scratch_);
}

void Resampler::draw_multinomial(const std::vector<double>& weight, RandomEngine& engine) {
  // Sorted uniforms from the sums of exponential spacings: a sort is not needed.
  double total = 0.0;
  for (double& s : scratch_) {
    total -= std::log(1.0 - draw_uniform(engine));
    s = total;
  }
  total -= std::log(1.0 - draw_uniform(engine));
  double cumulated = weight[0];
  std::uint32_t source = 0;
  for (std::size_t i = 0; i < parents_.size(); ++i) {
    while (scratch_[i] > cumulated * total && source + 1 < weight.size()) cumulated += weight[++source];
    parents_[i] = source;
  }
}

void Resampler::draw_systematic(const std::vector<double>& weight, RandomEngine& engine) {
  const double step = 1.0 / static_cast<double>(parents_.size());
  double position = step * draw_uniform(engine);
  double cumulated = weight[0];
  std::uint32_t source = 0;
  for (auto& parent : parents_) {
    while (position > cumulated && source + 1 < weight.size()) cumulated += weight[++source];
    parent = source;
    position += step;
  }
}

}  // namespace urban_gnss
