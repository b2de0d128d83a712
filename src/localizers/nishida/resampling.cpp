#include "urban_gnss_localization/localizers/nishida/resampling.hpp"

#include <algorithm>
#include <numeric>

namespace urban_gnss {
namespace {

/// Draws `count` numbers of the exponential distribution.
URBAN_GNSS_VECTORISED void draw_exponentials(const RandomStream& stream, std::size_t count, float* __restrict draws) {
  for (std::size_t i = 0; i < count; ++i) draws[i] = -vector_log(to_uniform(stream.words(i)[0]));
}

/// Added up as below, so that nothing is left for particles of no weight at the end.
double total_of(const std::vector<float>& weight) { return std::accumulate(weight.begin(), weight.end(), 0.0); }

}  // namespace

EnumNames<ResamplingScheme> enum_names(ResamplingScheme) {
  return {{"multinomial", ResamplingScheme::kMultinomial}, {"systematic", ResamplingScheme::kSystematic}};
}

Resampler::Resampler(std::size_t particle_count, ResamplingScheme scheme)
    : scheme_(scheme), parents_(particle_count), scratch_(particle_count) {}

void Resampler::resample(ParticleSet& particles, const RandomStream& stream) {
  if (scheme_ == ResamplingScheme::kMultinomial) {
    draw_multinomial(particles.weight, stream);
  } else {
    draw_systematic(particles.weight, stream);
  }
  for (std::vector<float>* values : {&particles.x, &particles.y, &particles.yaw}) {
    for (std::size_t i = 0; i < parents_.size(); ++i) scratch_[i] = (*values)[parents_[i]];
    values->swap(scratch_);
  }
  particles.set_equal_weights();
}

void Resampler::draw_multinomial(const std::vector<float>& weight, const RandomStream& stream) {
  // Sorted uniforms from the sums of exponential spacings: a sort is not needed.
  draw_exponentials(stream, scratch_.size(), scratch_.data());
  const double last = -vector_log(to_uniform(stream.words(scratch_.size())[0]));
  const double scale = total_of(weight) / std::accumulate(scratch_.begin(), scratch_.end(), last);
  double position = 0.0;
  double cumulated = weight[0];
  std::uint32_t source = 0;
  for (std::size_t i = 0; i < parents_.size(); ++i) {
    position += scale * scratch_[i];
    while (position > cumulated && source + 1 < weight.size()) cumulated += weight[++source];
    parents_[i] = source;
  }
}

void Resampler::draw_systematic(const std::vector<float>& weight, const RandomStream& stream) {
  // Every particle marks where its copies begin. One that has none is overwritten by the next; the largest mark so far
  // is then the parent. Without a branch that the processor would have to guess.
  const std::size_t count = parents_.size();
  const double copies = static_cast<double>(count) / total_of(weight);
  const double offset = 1.0 - to_uniform(stream.words(0)[0]);
  std::fill(parents_.begin(), parents_.end(), 0U);
  double cumulated = 0.0;
  std::size_t begin = 0;
  for (std::size_t source = 0; source < count && begin < count; ++source) {
    parents_[begin] = static_cast<std::uint32_t>(source);
    cumulated += weight[source];
    begin = static_cast<std::size_t>(cumulated * copies + offset);
  }
  std::uint32_t parent = 0;
  for (auto& mark : parents_) mark = parent = std::max(parent, mark);
}

}  // namespace urban_gnss
