#include "urban_gnss_localization/pipeline/bias_responder.hpp"

namespace urban_gnss {

std::vector<BiasEstimate> BiasResponder::answer(LocalizationPipeline& pipeline) {
  if (pipeline.epoch() != epoch_) {
    epoch_ = pipeline.epoch();
    tracker_.reset();
  }
  std::vector<BiasEstimate> answers;
  while (const auto query = pipeline.bias_query()) {
    answers.push_back(tracker_.process(query->fix, query->predicted_antenna_position, query->validation));
    pipeline.add_bias(answers.back());
  }
  return answers;
}

}  // namespace urban_gnss
