#pragma once

#include <string>

namespace urban_gnss {

/// Something that happened and that people should hear of once.
struct PipelineEvent {
  enum class Level { kInfo, kWarn, kError };
  Level level{Level::kInfo};
  std::string text;
};

}  // namespace urban_gnss
