#pragma once

#include <cstddef>
#include <vector>

#include "urban_gnss_localization/localizers/nishida/bias_kalman_filter.hpp"
#include "urban_gnss_localization/pipeline/localization_pipeline.hpp"

namespace urban_gnss {

/// The bias filter beside a localizer in one process: answers what the localizer's pipeline asks, as gps_bias_node does
/// by gps/bias.
class BiasResponder {
 public:
  explicit BiasResponder(const GpsBiasParameters& parameters) : tracker_(parameters) {}

  /// Answers all that the pipeline asks, and returns the answers. Forgets what was tracked when the pipeline has begun
  /// another epoch.
  std::vector<BiasEstimate> answer(LocalizationPipeline& pipeline);

 private:
  BiasTracker tracker_;
  std::size_t epoch_{0};
};

}  // namespace urban_gnss
