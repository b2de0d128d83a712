#include "urban_gnss_localization/gnss/fix_validation.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <sstream>
#include <utility>

#include "urban_gnss_localization/gnss/position_hint.hpp"

namespace urban_gnss {
namespace {

std::string number(double value) {
  std::ostringstream out;
  out << value;
  return out.str();
}

void add_reason(FixOutcome& outcome, const std::string& reason) {
  outcome.reason += (outcome.reason.empty() ? "" : "; ") + reason;
}

std::string with_hint(const std::string& reason, const std::string& hint) {
  return hint.empty() ? reason : reason + ": " + hint;
}

std::string place_text(double latitude, double longitude) {
  std::ostringstream out;
  out.precision(10);
  out << "latitude " << latitude << ", longitude " << longitude;
  return out.str();
}

struct Rejection {
  FixDecision decision;
  std::string reason;
};

std::optional<Rejection> reject_position(const RawFix& raw) {
  const auto& [latitude, longitude, altitude] = raw.position;
  (void)altitude;
  if (!raw.has_fix) {
    const bool has_place = is_latitude(latitude) && is_longitude(longitude) && (latitude != 0.0 || longitude != 0.0);
    return Rejection{FixDecision::kRejectedStatus,
                     has_place ? "the receiver has no fix (its status is negative), though it gives a place"
                               : "the receiver has no fix"};
  }
  if (!std::isfinite(latitude) || !std::isfinite(longitude)) {
    return Rejection{FixDecision::kRejectedNonFinite, place_text(latitude, longitude) + " is not finite"};
  }
  if (raw.stamp < Stamp::zero()) {
    return Rejection{FixDecision::kRejectedOutOfRange, "negative stamp " + number(to_seconds(raw.stamp)) + " s"};
  }
  if (!is_latitude(latitude) || !is_longitude(longitude)) {
    return Rejection{FixDecision::kRejectedOutOfRange,
                     with_hint(place_text(latitude, longitude) + " is no place", hint_of_no_place(raw.position))};
  }
  if (latitude == 0.0 && longitude == 0.0) {
    return Rejection{FixDecision::kRejectedOutOfRange, "latitude and longitude are both 0"};
  }
  return std::nullopt;
}

std::optional<Rejection> reject_stamp(Stamp stamp, std::optional<Stamp> last_stamp) {
  if (!last_stamp || stamp > *last_stamp) return std::nullopt;
  if (stamp == Stamp::zero()) {
    return Rejection{FixDecision::kRejectedStale, "header.stamp of gps/fix is 0: its driver must set it"};
  }
  if (stamp == *last_stamp) return Rejection{FixDecision::kRejectedStale, "duplicate of the last fix's stamp"};
  return Rejection{FixDecision::kRejectedStale,
                   number(to_seconds(*last_stamp) - to_seconds(stamp)) + " s older than the last fix"};
}

/// The declared horizontal covariance as standard deviations and correlation, which neither overflow nor underflow.
/// Nothing where it cannot be used.
struct HorizontalCovariance {
  Eigen::Array2d sigma;
  double correlation;
};

std::optional<HorizontalCovariance> declared_covariance(const RawFix& raw) {
  const Eigen::Array2d sigma = raw.covariance.diagonal().head<2>().array().sqrt();  // NaN where negative
  if (!sigma.isFinite().all() || !(sigma > 0.0).all()) return std::nullopt;
  if (raw.covariance_type == CovarianceType::kDiagonalKnown) return HorizontalCovariance{sigma, 0.0};
  const double mean_off_diagonal = 0.5 * raw.covariance(0, 1) + 0.5 * raw.covariance(1, 0);
  const double correlation = mean_off_diagonal / sigma.x() / sigma.y();
  if (!(std::abs(correlation) < 1.0)) return std::nullopt;
  return HorizontalCovariance{sigma, correlation};
}

Eigen::Matrix2d clamp_covariance(HorizontalCovariance declared, const FixValidationParameters& parameters,
                                 FixOutcome& outcome) {
  const double floor = parameters.fix_sigma_floor;
  const double ceiling = parameters.fix_sigma_ceiling;
  // The eigenvalues of diag(1e300, 1) have no digits left for the 1. What is far above the ceiling ends at the ceiling.
  const Eigen::Array2d sigma = (declared.sigma * std::sqrt(parameters.fix_covariance_scale)).min(1e4 * ceiling);
  Eigen::Matrix2d covariance;
  covariance(0, 0) = sigma.x() * sigma.x();
  covariance(1, 1) = sigma.y() * sigma.y();
  covariance(0, 1) = covariance(1, 0) = declared.correlation * sigma.x() * sigma.y();

  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> ellipse(covariance);
  const Eigen::Array2d variances = ellipse.eigenvalues();
  const bool is_below = variances.minCoeff() < floor * floor;
  const bool is_above = variances.maxCoeff() > ceiling * ceiling;
  if (!is_below && !is_above) return covariance;

  outcome.covariance_clamped = true;
  if (is_below) {
    outcome.decision = FixDecision::kInflated;
    const double smallest = std::sqrt(std::max(variances.minCoeff(), 0.0));
    add_reason(outcome, "declared sigma " + number(smallest) + " m raised to the floor of " + number(floor) + " m");
  }
  if (is_above) add_reason(outcome, "declared sigma lowered to the ceiling of " + number(ceiling) + " m");
  const Eigen::Vector2d clamped = variances.max(floor * floor).min(ceiling * ceiling);
  const Eigen::Matrix2d& axes = ellipse.eigenvectors();
  const Eigen::Matrix2d product = axes * clamped.asDiagonal() * axes.transpose();
  return 0.5 * (product + product.transpose());
}

Eigen::Matrix2d usable_covariance(const RawFix& raw, const FixValidationParameters& parameters, FixOutcome& outcome) {
  const bool is_unknown = raw.covariance_type == CovarianceType::kUnknown;
  const auto declared = is_unknown ? std::nullopt : declared_covariance(raw);
  if (declared) return clamp_covariance(*declared, parameters, outcome);
  const double sigma = parameters.fix_sigma_default;
  outcome.decision = FixDecision::kInflated;
  outcome.covariance_clamped = true;
  add_reason(outcome, std::string(is_unknown ? "no covariance declared" : "declared covariance cannot be used") +
                          ": default sigma " + number(sigma) + " m");
  return sigma * sigma * Eigen::Matrix2d::Identity();
}

}  // namespace

void FixValidationParameters::check(std::vector<std::string>& faults) const {
  if (!(fix_sigma_floor <= fix_sigma_ceiling)) {
    faults.push_back("fix_sigma_floor = " + number(fix_sigma_floor) +
                     ": must be at most fix_sigma_ceiling = " + number(fix_sigma_ceiling));
  } else if (!(fix_sigma_floor <= fix_sigma_default && fix_sigma_default <= fix_sigma_ceiling)) {
    faults.push_back("fix_sigma_default = " + number(fix_sigma_default) + ": must be at least fix_sigma_floor = " +
                     number(fix_sigma_floor) + " and at most fix_sigma_ceiling = " + number(fix_sigma_ceiling));
  }
}

bool is_usable_position(const RawFix& raw) { return !reject_position(raw); }

std::optional<FixOutcome> reject_without_datum(const RawFix& raw, std::optional<Stamp> last_stamp) {
  std::optional<Rejection> rejection = reject_position(raw);
  if (!rejection) rejection = reject_stamp(raw.stamp, last_stamp);
  if (!rejection) return std::nullopt;
  FixOutcome outcome;
  outcome.stamp = raw.stamp;
  outcome.decision = rejection->decision;
  outcome.reason = rejection->reason;
  return outcome;
}

ValidatedFix validate_fix(const RawFix& raw, const LocalFrame& frame, std::optional<Stamp> last_stamp,
                          const FixValidationParameters& parameters) {
  ValidatedFix result;
  result.fix.stamp = raw.stamp;
  FixOutcome& outcome = result.outcome;
  outcome.stamp = raw.stamp;

  if (auto rejected = reject_without_datum(raw, last_stamp)) {
    outcome = std::move(*rejected);
    return result;
  }
  if (const auto reason = why_too_far(raw.position, frame, parameters.max_distance_from_datum, "datum");
      !reason.empty()) {
    outcome.decision = FixDecision::kRejectedOutOfRange;
    outcome.reason = reason;
    return result;
  }

  outcome.decision = FixDecision::kAccepted;
  GeodeticPosition position = raw.position;
  if (!is_altitude(position.altitude_m)) {
    add_reason(outcome, "no usable altitude: the datum's is used");
    position.altitude_m = frame.datum().altitude_m;
  }
  result.fix.position = frame.to_local(position).head<2>();
  result.fix.covariance = usable_covariance(raw, parameters, outcome);
  return result;
}

}  // namespace urban_gnss
