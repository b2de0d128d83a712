#pragma once

#include <nlohmann/json.hpp>

#include "urban_gnss_localization/evaluation/trajectory_errors.hpp"

namespace urban_gnss {

/// JSON has no NaN: what is not finite becomes null. (The library would write it so by itself, but only in text.)
nlohmann::json number_or_null(double value);

/// The summary with its units in the names of the keys. What is not finite becomes null, as JSON has no NaN.
nlohmann::json to_json(const ErrorSummary& summary);

}  // namespace urban_gnss
