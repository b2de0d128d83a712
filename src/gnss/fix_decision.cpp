#include "urban_gnss_localization/gnss/fix_decision.hpp"

namespace urban_gnss {

const char* to_string(FixDecision decision) {
  switch (decision) {
    case FixDecision::kNotExamined: return "not_examined";
    case FixDecision::kAccepted: return "accepted";
    case FixDecision::kInflated: return "inflated";
    case FixDecision::kBiasCompensated: return "bias_compensated";
    case FixDecision::kRejectedGate: return "rejected_gate";
    case FixDecision::kRejectedStatus: return "rejected_status";
    case FixDecision::kRejectedNonFinite: return "rejected_non_finite";
    case FixDecision::kRejectedStale: return "rejected_stale";
    case FixDecision::kRejectedOutOfRange: return "rejected_out_of_range";
    case FixDecision::kRejectedDegenerate: return "rejected_degenerate";
  }
  return "unknown";  // a number from outside that names no decision
}

}  // namespace urban_gnss
