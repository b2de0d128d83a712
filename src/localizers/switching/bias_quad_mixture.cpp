#include "quad_states.hpp"

namespace urban_gnss {
namespace {

/// Divides the weights of the parts by their sum, which it returns. Where they are 0, part `otherwise` is all.
template <int kParts>
URBAN_GNSS_INLINE Quad share(Quad (&weight)[kParts], int otherwise) {
  Quad sum = weight[0];
  for (int part = 1; part < kParts; ++part) sum += weight[part];
  for (int part = 0; part < kParts; ++part) {
    weight[part] = sum > 0.0 ? weight[part] / sum : quad(part == otherwise ? 1.0 : 0.0);
  }
  return sum;
}

/// The yaw of the heaviest part, from which the yaws of the others count as differences.
struct HeaviestQuad {
  Quad weight, yaw;
};
template <int kParts, class YawOf>
URBAN_GNSS_INLINE HeaviestQuad heaviest_of(const Quad (&weight)[kParts], const YawOf& yaw_of) {
  HeaviestQuad heaviest{weight[0], yaw_of(0)};
  for (int part = 1; part < kParts; ++part) {
    const QuadBits is_heavier = weight[part] > heaviest.weight;
    heaviest.weight = is_heavier ? weight[part] : heaviest.weight;
    heaviest.yaw = is_heavier ? yaw_of(part) : heaviest.yaw;
  }
  return heaviest;
}

/// match_moments() of `kParts` states, one after the other: mean_of(part, i), covariance_of(part, i, j).
template <int kParts, class MeanOf, class CovarianceOf>
URBAN_GNSS_INLINE void mix(const Quad (&weight)[kParts], const MeanOf& mean_of, const CovarianceOf& covariance_of,
                           BiasQuad& whole) {
  const auto yaw_of = [&](int part) URBAN_GNSS_INLINE_LAMBDA { return mean_of(part, kYaw); };
  const Quad centre = heaviest_of(weight, yaw_of).yaw;
  Quad at[kBiasStates];
  const auto place_of = [&](int part, int i) URBAN_GNSS_INLINE_LAMBDA {
    return i == kYaw ? quad_wrap(mean_of(part, i) - centre) : mean_of(part, i);
  };
  for_each_state([&](int i) URBAN_GNSS_INLINE_LAMBDA { at[i] = place_of(0, i); });
  Quad apart[kParts][kBiasStates];     // of a part from the mean of those before it
  Quad variance[kParts][kBiasStates];  // what comes with it, but for a factor of `apart`
  Quad total = weight[0];
  for (int part = 1; part < kParts; ++part) {
    const Quad before = total;
    total += weight[part];
    const Quad share = total > 0.0 ? weight[part] / total : Quad{};
    for_each_state([&](int i) URBAN_GNSS_INLINE_LAMBDA {
      apart[part][i] = place_of(part, i) - at[i];
      at[i] += share * apart[part][i];
      variance[part][i] = before * share * apart[part][i];
    });
  }
  for_each_state([&](int i)
                     URBAN_GNSS_INLINE_LAMBDA { set_mean(whole, i, i == kYaw ? quad_wrap(centre + at[i]) : at[i]); });
  for_each_pair([&](int i, int j) URBAN_GNSS_INLINE_LAMBDA {
    Quad sum = weight[0] * covariance_of(0, i, j);
    for (int part = 1; part < kParts; ++part) {
      sum += weight[part] * covariance_of(part, i, j) + variance[part][i] * apart[part][j];
    }
    set_covariance(whole, i, j, sum);
  });
}

/// Means of all filters together.
class WholeMean {
 public:
  URBAN_GNSS_INLINE WholeMean(const BiasQuads& filters, const QualityNumbers& probability) : filters_(filters) {
    for (std::size_t level = 0; level < kQualityLevels; ++level) weights[level] = load(probability[level].data());
    const auto yaw_of = [&](int level)
                            URBAN_GNSS_INLINE_LAMBDA { return mean(filters[static_cast<std::size_t>(level)], kYaw); };
    const HeaviestQuad heaviest = heaviest_of(weights, yaw_of);
    int mode = 0;
    for (int m = 1; m < static_cast<int>(kLastingModes); ++m) {
      if (heaviest.weight[m] > heaviest.weight[mode]) mode = m;
    }
    yaw_ = heaviest.yaw[mode];
  }
  /// match_means() in one state.
  URBAN_GNSS_INLINE double operator()(int i) const {
    const double centre = i == kYaw ? yaw_ : filters_[0].mean[static_cast<std::size_t>(i)][0];
    Quad moved{};
    for (std::size_t k = 0; k < kQualityLevels; ++k) {
      moved += weights[k] * difference_of(i, mean(filters_[k], i), quad(centre));
    }
    const double at = centre + sum_of(moved);
    return i == kYaw ? wrap_angle(at) : at;
  }

  Quad weights[kQualityLevels];

 private:
  const BiasQuads& filters_;
  double yaw_;  ///< of the heaviest
};

/// match_moments() of all in the first `kStates` states.
template <int kStates>
URBAN_GNSS_INLINE void match_moments(const BiasQuads& filters, const QualityNumbers& probability,
                                     Eigen::Matrix<double, kStates, 1>& centre,
                                     Eigen::Matrix<double, kStates, kStates>& spread) {
  const WholeMean mean_of(filters, probability);
  Quad apart[kStates][kQualityLevels];
  for_each_state<kStates>([&](int i) URBAN_GNSS_INLINE_LAMBDA {
    centre[i] = mean_of(i);
    for (std::size_t k = 0; k < kQualityLevels; ++k) {
      apart[i][k] = difference_of(i, mean(filters[k], i), quad(centre[i]));
    }
  });
  for_each_pair<kStates>([&](int i, int j) URBAN_GNSS_INLINE_LAMBDA {
    Quad sum{};
    for (std::size_t k = 0; k < kQualityLevels; ++k) {
      sum += mean_of.weights[k] * (covariance(filters[k], i, j) + apart[i][k] * apart[j][k]);
    }
    spread(i, j) = spread(j, i) = sum_of(sum);
  });
}

}  // namespace

URBAN_GNSS_VECTORISED Pose2 pose_of(const BiasQuads& filters, const QualityNumbers& probability) {
  const WholeMean mean_of(filters, probability);
  return {mean_of(0), mean_of(1), mean_of(kYaw)};
}

URBAN_GNSS_VECTORISED PoseEstimate pose_estimate_of(const BiasQuads& filters, const QualityNumbers& probability) {
  Eigen::Vector3d mean;
  PoseEstimate estimate;
  match_moments(filters, probability, mean, estimate.covariance);
  estimate.pose = {mean[0], mean[1], mean[kYaw]};
  return estimate;
}

URBAN_GNSS_VECTORISED BiasGaussian mixture_of(const BiasQuads& filters, const QualityNumbers& probability) {
  BiasGaussian whole;
  match_moments(filters, probability, whole.mean, whole.covariance);
  return whole;
}

URBAN_GNSS_VECTORISED ModeNumbers mix_qualities(const BiasQuads& filters, const QualityNumbers& weights,
                                                std::size_t otherwise, BiasQuad& mixed) {
  Quad weight[kQualityLevels];
  for (std::size_t level = 0; level < kQualityLevels; ++level) weight[level] = load(weights[level].data());
  ModeNumbers sums;
  store(share(weight, static_cast<int>(otherwise)), sums.data());
  mix(
      weight,
      [&](int part, int i) URBAN_GNSS_INLINE_LAMBDA { return mean(filters[static_cast<std::size_t>(part)], i); },
      [&](int part, int i, int j)
          URBAN_GNSS_INLINE_LAMBDA { return covariance(filters[static_cast<std::size_t>(part)], i, j); },
      mixed);
  return sums;
}

URBAN_GNSS_VECTORISED ModeNumbers continue_biases(const BiasQuad& before,
                                                  const std::array<ModeNumbers, kLastingModes>& weights,
                                                  const BiasSteps& steps, BiasQuad& after) {
  Quad weight[kLastingModes];
  Quad left[kLastingModes];
  Quad growth[kLastingModes];
  for (std::size_t from = 0; from < kLastingModes; ++from) {
    weight[from] = load(weights[from].data());
    for (int to = 0; to < static_cast<int>(kContinuations); ++to) {
      left[from][to] = steps[from][static_cast<std::size_t>(to)].left;
      growth[from][to] = steps[from][static_cast<std::size_t>(to)].growth_m2;
    }
  }
  ModeNumbers sums;
  store(share(weight, static_cast<int>(index_of(BiasMode::kDirect))), sums.data());
  mix(
      weight,
      [&](int part, int i) URBAN_GNSS_INLINE_LAMBDA {
        const Quad old = quad(before.mean[static_cast<std::size_t>(i)][static_cast<std::size_t>(part)]);
        return i < kBias ? old : left[part] * old;
      },
      [&](int part, int i, int j) URBAN_GNSS_INLINE_LAMBDA {
        Quad old = quad(before.covariance[BiasQuad::pair(i, j)][static_cast<std::size_t>(part)]);
        if (j >= kBias) old *= left[part];
        if (i >= kBias) old *= left[part];
        return i >= kBias && i == j ? old + growth[part] : old;
      },
      after);
  return sums;
}

URBAN_GNSS_VECTORISED void merge_jump(const BiasQuad& before, double slow, double jump, BiasQuad& merged) {
  const Quad weight[2] = {{1.0, slow, 1.0, 1.0}, {0.0, jump, 0.0, 0.0}};
  constexpr std::size_t kJump = index_of(BiasMode::kJump);
  mix(
      weight,
      [&](int part, int i) URBAN_GNSS_INLINE_LAMBDA {
        return part == 0 ? mean(before, i) : quad(before.mean[static_cast<std::size_t>(i)][kJump]);
      },
      [&](int part, int i, int j) URBAN_GNSS_INLINE_LAMBDA {
        return part == 0 ? covariance(before, i, j) : quad(before.covariance[BiasQuad::pair(i, j)][kJump]);
      },
      merged);
}

URBAN_GNSS_VECTORISED void weigh(QualityNumbers& probability, const BiasQuadUpdates& updates, double largest) {
  Quad posterior[kQualityLevels];
  Quad sums{};
  for (std::size_t level = 0; level < kQualityLevels; ++level) {
    const Quad likelihood = quad_exp(load(updates[level].log_likelihood.data()) - largest);
    const Quad prior = load(probability[level].data());
    posterior[level] = prior > 0.0 ? prior * likelihood : Quad{};
    sums += posterior[level];
  }
  const double sum = sum_of(sums);
  for (std::size_t level = 0; level < kQualityLevels; ++level) store(posterior[level] / sum, probability[level].data());
}

}  // namespace urban_gnss
