#pragma once

#include <optional>
#include <string>
#include <vector>

#include "urban_gnss_localization/common/parameters.hpp"
#include "urban_gnss_localization/geometry/local_frame.hpp"
#include "urban_gnss_localization/gnss/fix.hpp"
#include "urban_gnss_localization/gnss/fix_decision.hpp"

namespace urban_gnss {

/// What is believed of a receiver's own covariance, and how far from the datum a fix may lie.
struct FixValidationParameters {
  double fix_sigma_default{4.0};
  double fix_sigma_floor{0.3};
  double fix_sigma_ceiling{1000.0};
  double fix_covariance_scale{1.0};
  double max_distance_from_datum{100000.0};

  void visit(ParameterVisitor& v) {
    v.basic()("fix_sigma_default", fix_sigma_default, positive(), "m per axis",
              "standard deviation of a fix that declares no usable covariance");
    v("fix_sigma_floor", fix_sigma_floor, positive(), "m per axis",
      "least standard deviation of a fix; smaller declared ones are raised to it");
    v("fix_sigma_ceiling", fix_sigma_ceiling, positive(), "m per axis",
      "greatest standard deviation of a fix; larger declared ones are lowered to it");
    v("fix_covariance_scale", fix_covariance_scale, positive(), "",
      "factor on the declared covariance (a variance), before floor and ceiling");
    v("max_distance_from_datum", max_distance_from_datum, positive(), "m",
      "distance from the datum beyond which a fix is rejected");
  }
  void check(std::vector<std::string>& faults) const;
};

/// A fix after validation. Where is_rejected(outcome.decision), only the stamp of `fix` is set.
struct ValidatedFix {
  LocalFix fix;
  FixOutcome outcome;
};

/// The part of validation that needs neither datum nor history: in this order, the receiver has a fix (else
/// kRejectedStatus); latitude and longitude are finite (else kRejectedNonFinite); the stamp is not negative, they name
/// a place, and are not both exactly 0, which is what receivers report before they know (else kRejectedOutOfRange).
bool is_usable_position(const RawFix& raw);

/// What is decided of a fix that cannot be used wherever the datum is: is_usable_position() refuses it, or its stamp is
/// not newer than `last_stamp` (kRejectedStale). Nothing where it can.
std::optional<FixOutcome> reject_without_datum(const RawFix& raw, std::optional<Stamp> last_stamp);

/// Decides whether a fix can be used at all, and transforms it to the map frame with a usable covariance: finite and
/// positive definite for every input. Never throws because of the input.
///
/// The first check that fails decides: those of reject_without_datum(), then the distance from the datum (else
/// kRejectedOutOfRange). An altitude that no receiver on the ground can have does not reject a horizontal fix: the
/// datum's is used.
///
/// The covariance is the declared horizontal block times `fix_covariance_scale`; its off-diagonal elements are not
/// declared, and not used, where the type is kDiagonalKnown. Where the type is kUnknown, or the block is not finite or
/// not positive definite (all zero, say), it is that of `fix_sigma_default`. Else the axes of its ellipse are clamped
/// to the floor and the ceiling, each in its own direction. The decision is kInflated where the default or the floor
/// was used, else kAccepted; outcome.covariance_clamped tells of all three.
///
/// `last_stamp` is the stamp of the fix handled last, nothing at the start. Requires parameters without faults.
ValidatedFix validate_fix(const RawFix& raw, const LocalFrame& frame, std::optional<Stamp> last_stamp,
                          const FixValidationParameters& parameters);

}  // namespace urban_gnss
