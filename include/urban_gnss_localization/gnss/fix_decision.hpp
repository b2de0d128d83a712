#pragma once

#include <cstdint>
#include <limits>
#include <string>

#include "urban_gnss_localization/common/stamp.hpp"

namespace urban_gnss {

/// What was decided about a fix. The values are those of FixDecision.msg.
enum class FixDecision : std::uint8_t {
  kNotExamined = 0,
  kAccepted = 1,
  kInflated = 2,
  kBiasCompensated = 3,
  kRejectedGate = 4,
  kRejectedStatus = 5,
  kRejectedNonFinite = 6,
  kRejectedStale = 7,
  kRejectedOutOfRange = 8,
  kRejectedDegenerate = 9,
};

/// The name used in messages for people and in tables, e.g. "rejected_gate".
const char* to_string(FixDecision decision);

inline bool is_rejected(FixDecision decision) { return decision >= FixDecision::kRejectedGate; }

/// A decision with its evidence; NaN and 0 where nothing was computed.
struct FixOutcome {
  Stamp stamp{0};
  FixDecision decision{FixDecision::kNotExamined};
  double nis{std::numeric_limits<double>::quiet_NaN()};            ///< normalised innovation squared
  double nis_threshold{std::numeric_limits<double>::quiet_NaN()};  ///< chi-square quantile it was compared with
  int nis_dof{0};
  bool covariance_clamped{false};
  bool of_ranges{false};  ///< its ranges were taken in place of its position
  std::string reason;
};

}  // namespace urban_gnss
