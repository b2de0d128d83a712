#include "urban_gnss_localization/localizers/switching/mixture_reduction.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace urban_gnss {
namespace {

constexpr int kYaw = 2;

bool has_same_heading(const BiasGaussian& a, const BiasGaussian& b) {
  return std::abs(angle_difference(a.mean[kYaw], b.mean[kYaw])) < MixtureReducer::kSameHeading;
}

}  // namespace

double marginal_distance(const BiasGaussian& a, const BiasGaussian& b) {
  double distance = 0.0;
  double widths = 1.0;
  for (int k = 0; k < kBiasStates; ++k) {
    const double difference = k == kYaw ? angle_difference(a.mean[k], b.mean[k]) : a.mean[k] - b.mean[k];
    const double p = a.covariance(k, k);
    const double q = b.covariance(k, k);
    if (difference == 0.0 && p == q) continue;
    distance += 0.25 * difference * difference / (p + q);
    widths *= 0.25 * (p + q) * (p + q) / (p * q);
  }
  return distance + 0.25 * std::log(widths);
}

double selection_threshold(const std::vector<double>& descending, std::size_t most) {
  if (descending.size() <= most) return 0.0;
  double rest = std::accumulate(descending.begin(), descending.end(), 0.0);
  for (std::size_t kept = 0; kept < most; ++kept) {
    const double c = rest / static_cast<double>(most - kept);
    if (descending[kept] <= c) return c;
    rest -= descending[kept];
  }
  return descending[most];
}

MixtureReducer::MixtureReducer(std::size_t most_before) {
  order_.reserve(most_before);
  kept_.reserve(most_before);
  weights_.reserve(most_before);
  scratch_.reserve(most_before);
}

void MixtureReducer::sort(const std::vector<BiasHypothesis>& hypotheses) {
  order_.resize(hypotheses.size());
  std::iota(order_.begin(), order_.end(), 0U);
  std::sort(order_.begin(), order_.end(), [&](std::uint32_t a, std::uint32_t b) {
    return hypotheses[a].weight != hypotheses[b].weight ? hypotheses[a].weight > hypotheses[b].weight : a < b;
  });
}

void MixtureReducer::merge(std::vector<BiasHypothesis>& hypotheses, double distance) {
  sort(hypotheses);
  kept_.clear();
  for (const std::uint32_t i : order_) {
    BiasHypothesis& other = hypotheses[i];
    if (!(other.weight > 0.0)) break;
    const auto same = std::find_if(kept_.begin(), kept_.end(), [&](std::uint32_t k) {
      return hypotheses[k].mode == other.mode && hypotheses[k].quality == other.quality &&
             has_same_heading(hypotheses[k].state, other.state) &&
             marginal_distance(hypotheses[k].state, other.state) < distance;
    });
    if (same == kept_.end()) {
      kept_.push_back(i);
      continue;
    }
    BiasHypothesis& one = hypotheses[*same];
    const double sum = one.weight + other.weight;
    one.state = match_moments(
        2, [&](std::size_t part) -> const BiasGaussian& { return part == 0 ? one.state : other.state; },
        [&](std::size_t part) { return (part == 0 ? one : other).weight / sum; });
    one.weight = sum;
  }
  scratch_.clear();
  for (const std::uint32_t k : kept_) scratch_.push_back(hypotheses[k]);
  hypotheses.swap(scratch_);
}

void MixtureReducer::select(std::vector<BiasHypothesis>& hypotheses, std::size_t most, RandomEngine& engine) {
  sort(hypotheses);
  weights_.clear();
  for (const std::uint32_t i : order_) weights_.push_back(hypotheses[i].weight);
  const double c = std::max(selection_threshold(weights_, most), kNegligible);
  scratch_.clear();
  double next = c * draw_uniform(engine);  // where the next draw is in the sum of the light ones
  double sum = 0.0;
  for (const std::uint32_t i : order_) {
    const double weight = hypotheses[i].weight;
    if (weight < c) {
      next -= weight;
      if (next > 0.0) continue;
      next += c;
    }
    scratch_.push_back(hypotheses[i]);
    sum += scratch_.back().weight = std::max(weight, c);
  }
  for (BiasHypothesis& hypothesis : scratch_) hypothesis.weight /= sum;
  hypotheses.swap(scratch_);
}

}  // namespace urban_gnss
