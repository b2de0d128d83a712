#pragma once

#include <nlohmann/json.hpp>

#include "urban_gnss_localization/evaluation/trajectory_errors.hpp"

namespace urban_gnss {

/// The summary with its units in the names of the keys. What is not finite becomes null, as JSON has no NaN.
nlohmann::json to_json(const ErrorSummary& summary);

}  // namespace urban_gnss
