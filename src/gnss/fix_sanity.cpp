#include "urban_gnss_localization/gnss/fix_sanity.hpp"

#include <cmath>
#include <sstream>
#include <utility>

#include "urban_gnss_localization/gnss/position_hint.hpp"

namespace urban_gnss {
namespace {

using Mistake = CovarianceMistake;

/// Fixes in a row after which a wrong place is no accident.
constexpr std::size_t kMisplacedFixes = 3;
constexpr double kSbasSigma_m = 0.1;  ///< nmea_navsat_driver's epe_quality2

bool is_declared(const RawFix& raw) { return raw.covariance_type != CovarianceType::kUnknown; }

/// Horizontally; the height may have no variance.
bool is_diagonal(const RawFix& raw) {
  return raw.covariance.diagonal().head<2>().allFinite() && raw.covariance.isDiagonal(0.0);
}

/// Whether a number is one of few decimals: a multiple of `step`, but for rounding.
bool is_on_grid(double value, double step) {
  const double steps = value / step;
  return std::abs(steps - std::round(steps)) < 1e-5 && steps > 0.5;
}

/// A dilution of precision: two decimals at the most.
bool is_dop(double value) { return value >= 0.4 && value < 50.0 && is_on_grid(value, 0.01); }

bool is_round(const RawFix& raw) { return is_diagonal(raw) && raw.covariance(0, 0) == raw.covariance(1, 1); }

double ratio_up(const RawFix& raw) { return raw.covariance(2, 2) / raw.covariance(0, 0); }
bool is_ratio(double ratio, double expected) { return std::abs(ratio - expected) < 1e-5 * expected; }

bool has_three_decimals(const RawFix& raw) {
  if (!is_declared(raw) || raw.covariance_type == CovarianceType::kKnown || !is_diagonal(raw)) return false;
  return is_on_grid(raw.covariance(0, 0), 1e-3) && is_on_grid(raw.covariance(1, 1), 1e-3);
}

/// The variance as evidence of kSigmaForVariance. A sigma has few decimals, and so has its square, but then a variance
/// of three decimals is the square of a number of two at the most.
std::optional<double> evidence_of_sigma(const RawFix& raw) {
  const double variance = raw.covariance(0, 0);
  if (is_on_grid(std::sqrt(variance), 1e-2)) return std::nullopt;
  return variance;
}

bool is_hdop_squared(const RawFix& raw) {
  if (raw.covariance_type != CovarianceType::kApproximated || !is_round(raw)) return false;
  if (!is_dop(std::sqrt(raw.covariance(0, 0)))) return false;
  return is_ratio(ratio_up(raw), 4.0) || is_dop(std::sqrt(raw.covariance(2, 2)));
}

/// The variance as evidence of kHdopSquared: a DOP is small under an open sky. Accuracies in decimetres are no DOPs,
/// unless the height's is a multiple of them.
std::optional<double> evidence_of_hdop(const RawFix& raw) {
  constexpr double kOpenSky = 2.5;
  const double hdop = std::sqrt(raw.covariance(0, 0));
  if (hdop > kOpenSky || (!is_ratio(ratio_up(raw), 4.0) && is_on_grid(hdop, 0.1))) return std::nullopt;
  return raw.covariance(0, 0);
}

bool is_sbas_decimetre(const RawFix& raw) {
  if (!raw.has_sbas || raw.covariance_type != CovarianceType::kApproximated || !is_round(raw)) return false;
  return is_dop(std::sqrt(raw.covariance(0, 0)) / kSbasSigma_m) && raw.covariance(0, 0) < 1.0 &&
         is_ratio(ratio_up(raw), 16.0);
}

bool is_square_degrees(const RawFix& raw) {
  const Eigen::Vector2d variances = raw.covariance.diagonal().head<2>();
  return is_declared(raw) && variances.allFinite() && variances.minCoeff() > 0.0 && variances.maxCoeff() < 1e-8;
}

bool is_zeros(const RawFix& raw) { return is_declared(raw) && raw.covariance.isZero(0.0); }

bool is_no_variance(const RawFix& raw) {
  const Eigen::Vector2d variances = raw.covariance.diagonal().head<2>();
  return is_declared(raw) && (!variances.allFinite() || variances.minCoeff() < 0.0);
}

bool is_huge(const RawFix& raw) {
  const Eigen::Vector2d variances = raw.covariance.diagonal().head<2>();
  return is_declared(raw) && variances.allFinite() && variances.minCoeff() > 1e6;
}

bool is_type_forgotten(const RawFix& raw) {
  const Eigen::Vector2d variances = raw.covariance.diagonal().head<2>();
  return !is_declared(raw) && variances.allFinite() && variances.minCoeff() > 0.0;
}

/// How a mistake shows.
struct Pattern {
  bool (*shows)(const RawFix&);
  std::size_t fixes;                                          ///< in a row
  std::size_t variances{0};                                   ///< different ones among them
  std::optional<double> (*evidence)(const RawFix&){nullptr};  ///< what counts as one; null: nothing needs to
};

const Pattern& pattern_of(Mistake mistake) {
  static const Pattern kPatterns[kCovarianceMistakes] = {
      {has_three_decimals, 10, 4, evidence_of_sigma},
      {is_hdop_squared, 10, 2, evidence_of_hdop},
      {is_sbas_decimetre, 5},
      {is_square_degrees, 5},
      {is_zeros, 5},
      {is_no_variance, 5},
      {is_huge, 15},
      {is_type_forgotten, 5},
      {is_declared, 100},
  };
  return kPatterns[static_cast<std::size_t>(mistake)];
}

std::string metres(double value) {
  std::ostringstream out;
  out << value << " m";
  return out.str();
}

std::string describe(Mistake mistake, const RawFix& raw, double default_m, bool is_corrected) {
  const std::string default_sigma = metres(default_m);
  const std::string declared = metres(std::sqrt(raw.covariance(0, 0)));
  const std::string kept = "; left as it is, since fix_covariance_scale is set";
  const auto used = [&](const std::string& what) { return is_corrected ? "; " + what + " is used" : kept; };
  switch (mistake) {
    case Mistake::kSigmaForVariance:
      return "gps/fix has sigma where sigma^2 belongs, in variances of three decimals, as gpsd_client's fix has it" +
             used("the square");
    case Mistake::kHdopSquared:
      return "gps/fix has HDOP^2 as its variance, as an old nmea_navsat_driver or mavros without MAVLink 2 has it" +
             used(default_sigma + " (fix_sigma_default) times HDOP");
    case Mistake::kSbasDecimetre:
      return "gps/fix has a sigma of 0.1 m times HDOP because of SBAS (nmea_navsat_driver's epe_quality2), which no "
             "single receiver keeps" +
             used(default_sigma + " (fix_sigma_default) times HDOP");
    case Mistake::kSquareDegrees:
      return "gps/fix declares a sigma of " + declared + ", which is none: in square degrees?" +
             used(default_sigma + " (fix_sigma_default)");
    case Mistake::kZeros:
      return "gps/fix declares a covariance of zeros as known; " + default_sigma +
             " (fix_sigma_default) is used. Its driver should set the type UNKNOWN, or the receiver's accuracy";
    case Mistake::kNoVariance:
      return "gps/fix declares a covariance that is NaN, infinite or negative as known (gpsd_client has NaN, where "
             "check_fix_by_variance is off); " +
             default_sigma + " (fix_sigma_default) is used";
    case Mistake::kHuge:
      return "gps/fix declares a sigma of " + declared +
             " in each fix: in millimetres, or a number for 'unknown'? "
             "Fixes hardly count";
    case Mistake::kTypeForgotten:
      return "gps/fix has a sigma of " + declared + " beside the type UNKNOWN, so that " + default_sigma +
             " (fix_sigma_default) is used. If it is the receiver's accuracy, its driver should set "
             "position_covariance_type";
    case Mistake::kConstant:
      return "gps/fix declares a sigma of " + declared + " in each of " + std::to_string(pattern_of(mistake).fixes) +
             " fixes: a constant of its driver, which says nothing of a " + "single fix";
  }
  return {};
}

/// What the driver has meant; nothing where that is not known.
std::optional<Eigen::Matrix3d> meant(Mistake mistake, const RawFix& raw, double default_m) {
  const double default_m2 = default_m * default_m;
  switch (mistake) {
    case Mistake::kSigmaForVariance: return raw.covariance.cwiseProduct(raw.covariance);
    case Mistake::kHdopSquared: return Eigen::Matrix3d(default_m2 * raw.covariance);
    case Mistake::kSbasDecimetre: return Eigen::Matrix3d(default_m2 / (kSbasSigma_m * kSbasSigma_m) * raw.covariance);
    case Mistake::kSquareDegrees: return Eigen::Matrix3d(default_m2 * Eigen::Matrix3d::Identity());
    default: return std::nullopt;
  }
}

constexpr char kInRadians[] = "latitude and longitude of a place at sea: in radians? They must be degrees";

}  // namespace

const char* to_string(CovarianceMistake mistake) {
  switch (mistake) {
    case Mistake::kSigmaForVariance: return "sigma in place of its square";
    case Mistake::kHdopSquared: return "HDOP^2 as variance";
    case Mistake::kSbasDecimetre: return "0.1 m x HDOP of SBAS";
    case Mistake::kSquareDegrees: return "a covariance in square degrees";
    case Mistake::kZeros: return "zeros declared as known";
    case Mistake::kNoVariance: return "no variance declared as known";
    case Mistake::kHuge: return "a huge covariance";
    case Mistake::kTypeForgotten: return "a covariance without its type";
    case Mistake::kConstant: return "a constant covariance";
  }
  return "?";
}

SaneFix FixSanity::add(const RawFix& raw) {
  SaneFix sane{raw, {}};
  if (!is_usable_position(raw)) {
    if (raw.has_fix) note(no_place_, hint_of_no_place(raw.position));
    return sane;
  }
  observe(raw);
  const std::optional<Mistake> mistake = current();
  if (!mistake) return sane;
  const bool is_left = parameters_.fix_covariance_scale != 1.0;
  const auto corrected = is_left ? std::nullopt : meant(*mistake, raw, parameters_.fix_sigma_default);
  if (corrected) {
    sane.fix.covariance = *corrected;
    sane.reason = std::string("declared covariance replaced: ") + to_string(*mistake);
  }
  bool& was_said = evidence_[static_cast<std::size_t>(*mistake)].was_said;
  if (!std::exchange(was_said, true)) {
    news_.push_back({*mistake != Mistake::kConstant,
                     describe(*mistake, raw, parameters_.fix_sigma_default, corrected.has_value())});
  }
  return sane;
}

void FixSanity::observe(const RawFix& raw) {
  for (std::size_t i = 0; i < kCovarianceMistakes; ++i) {
    const Mistake mistake = static_cast<Mistake>(i);
    const Pattern& pattern = pattern_of(mistake);
    Evidence& evidence = evidence_[i];
    const bool is_same = mistake != Mistake::kConstant || (last_ && last_->covariance == raw.covariance &&
                                                           last_->covariance_type == raw.covariance_type);
    if (!is_same || !pattern.shows(raw)) {
      evidence.fixes = 0;
      evidence.variances.clear();
    }
    if (!pattern.shows(raw)) continue;
    ++evidence.fixes;
    if (pattern.evidence == nullptr || evidence.variances.size() >= pattern.variances) continue;
    if (const auto variance = pattern.evidence(raw)) evidence.variances.insert(*variance);
  }
  note(no_place_, looks_like_radians(raw.position) ? kInRadians : "");
  last_ = raw;
}

void FixSanity::note(Misplaced& misplaced, const std::string& hint) {
  misplaced.fixes = hint.empty() ? 0 : misplaced.fixes + 1;
  if (misplaced.fixes < kMisplacedFixes || std::exchange(misplaced.was_said, true)) return;
  news_.push_back({true, "gps/fix is in the wrong place: " + hint});
}

bool FixSanity::is_shown(CovarianceMistake mistake) const {
  const Pattern& pattern = pattern_of(mistake);
  const Evidence& evidence = evidence_[static_cast<std::size_t>(mistake)];
  return evidence.fixes >= pattern.fixes && evidence.variances.size() >= pattern.variances;
}

std::optional<CovarianceMistake> FixSanity::current() const {
  for (std::size_t i = 0; i < kCovarianceMistakes; ++i) {
    if (is_shown(static_cast<Mistake>(i))) return static_cast<Mistake>(i);
  }
  return std::nullopt;
}

std::string FixSanity::complaint() const {
  const auto mistake = current();
  if (!mistake || mistake == Mistake::kConstant) return {};
  return std::string("gps/fix has ") + to_string(*mistake);
}

std::vector<FixSanity::News> FixSanity::take_news() { return std::exchange(news_, {}); }

}  // namespace urban_gnss
