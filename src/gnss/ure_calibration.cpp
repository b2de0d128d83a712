#include "urban_gnss_localization/gnss/ure_calibration.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <set>
#include <stdexcept>
#include <string>

#include "urban_gnss_localization/common/median.hpp"
#include "urban_gnss_localization/gnss/dilution_of_precision.hpp"

namespace urban_gnss {
namespace {

/// Of the ranges of a receiver without carrier phases it is never so small.
constexpr double kLeastSigma_m = 0.01;

constexpr std::size_t kFewestFixes = 30;

/// A fix of a good geometry.
struct Sample {
  Stamp stamp;
  Eigen::Vector2d position;
  Eigen::Matrix2d information;  ///< M^-1 of its horizontal M
  double hdop;
};

/// Those that the receiver's solution is made of.
std::vector<SatelliteObservation> used_satellites(const std::vector<SatelliteObservation>& satellites) {
  const bool has_residuals = std::any_of(satellites.begin(), satellites.end(),
                                         [](const auto& each) { return std::isfinite(each.residual_m); });
  std::vector<SatelliteObservation> used;
  std::set<SatelliteId> seen;
  for (const SatelliteObservation& each : satellites) {
    const bool is_used = has_residuals ? std::isfinite(each.residual_m) : each.tracked;
    if (is_used && has_direction(each) && seen.insert(each.id).second) used.push_back(each);
  }
  return used;
}

std::optional<DilutionOfPrecision> dilution_of(const std::vector<SatelliteObservation>& used) {
  std::vector<RangingSatellite> ranging;
  for (const SatelliteObservation& each : used) {
    ranging.push_back({line_of_sight(each.look), static_cast<int>(clock_of(each.id.constellation)), 1.0});
  }
  return dilution_of_precision(ranging);
}

/// Sums the residuals of epochs.
class ResidualSum {
 public:
  void add(const std::vector<SatelliteObservation>& used) {
    std::set<Constellation> clocks;
    double squares_m2 = 0.0;
    for (const SatelliteObservation& each : used) {
      if (!std::isfinite(each.residual_m)) return;
      clocks.insert(clock_of(each.id.constellation));
      squares_m2 += each.residual_m * each.residual_m;
    }
    if (used.size() <= 3 + clocks.size()) return;
    squares_m2_ += squares_m2;
    freedom_ += used.size() - 3 - clocks.size();
    count_ += used.size();
  }
  std::size_t count() const { return count_; }
  std::optional<double> sigma_m() const {
    return freedom_ > 0 ? std::optional<double>(std::sqrt(squares_m2_ / static_cast<double>(freedom_))) : std::nullopt;
  }

 private:
  double squares_m2_{0.0};
  std::size_t freedom_{0};
  std::size_t count_{0};
};

/// The mean of the fixes, each with the weight of its geometry.
Eigen::Vector2d mean_place(const std::vector<Sample>& samples) {
  Eigen::Matrix2d information = Eigen::Matrix2d::Zero();
  Eigen::Vector2d weighted = Eigen::Vector2d::Zero();
  for (const Sample& each : samples) {
    information += each.information;
    weighted += each.information * each.position;
  }
  return information.ldlt().solve(weighted);
}

/// s, after which the correlation of the errors has fallen below 1/e; at least the mean time between two of them. The
/// errors are in units of sigma, evenly spaced but for gaps.
double correlation_time_s(const std::vector<Eigen::Vector2d>& errors, double interval_s) {
  const std::size_t count = errors.size();
  double variance = 0.0;
  for (const Eigen::Vector2d& each : errors) variance += each.squaredNorm() / static_cast<double>(count);
  for (std::size_t lag = 1; lag < count / 2; ++lag) {
    double product = 0.0;
    for (std::size_t i = lag; i < count; ++i) product += errors[i].dot(errors[i - lag]);
    if (product / static_cast<double>(count - lag) < variance / std::exp(1.0)) {
      return interval_s * static_cast<double>(lag);
    }
  }
  return interval_s * static_cast<double>(count) / 2.0;
}

[[noreturn]] void refuse(const UreCalibration& found, std::size_t all, double max_hdop) {
  const std::string of_all = " of " + std::to_string(all) + " fixes";
  if (found.without_satellites == all) {
    throw std::runtime_error(
        "no fix has the directions of at least 4 satellites (and one more for each further "
        "constellation)");
  }
  throw std::runtime_error("too few fixes to calibrate with: " + std::to_string(found.fixes) + of_all +
                           " can be used, at least " + std::to_string(kFewestFixes) + " are needed; " +
                           std::to_string(found.without_satellites) + " have too few satellites, " +
                           std::to_string(found.above_max_hdop) + " an HDOP above " + std::to_string(max_hdop));
}

}  // namespace

UreCalibration calibrate_ure(const std::vector<StationaryFix>& fixes, const UreCalibrationSettings& settings) {
  UreCalibration found;
  std::vector<Sample> samples;
  std::vector<double> hdops;
  ResidualSum residuals;
  for (const StationaryFix& fix : fixes) {
    const std::vector<SatelliteObservation> used = used_satellites(fix.satellites);
    const auto dop = dilution_of(used);
    if (!dop) {
      ++found.without_satellites;
    } else if (dop->hdop() > settings.max_hdop) {
      ++found.above_max_hdop;
    } else {
      samples.push_back({fix.stamp, fix.position, dop->horizontal().inverse(), dop->hdop()});
      hdops.push_back(dop->hdop());
      residuals.add(used);
    }
  }
  found.fixes = samples.size();
  if (samples.size() < kFewestFixes) refuse(found, fixes.size(), settings.max_hdop);
  found.median_hdop = upper_median(hdops);
  found.residuals = residuals.count();
  found.residual_sigma_m = residuals.sigma_m();

  const auto count = static_cast<double>(samples.size());
  const Eigen::Vector2d place = settings.place.value_or(mean_place(samples));
  std::vector<Eigen::Vector2d> errors;
  double squares = 0.0;
  for (const Sample& each : samples) {
    const Eigen::Matrix2d root = each.information.llt().matrixU();
    errors.push_back(root * (each.position - place));
    squares += errors.back().squaredNorm();
  }
  found.duration_s = to_seconds(samples.back().stamp - samples.front().stamp);
  const double interval_s = found.duration_s / (count - 1.0);
  found.error_lasts_s = correlation_time_s(errors, interval_s);
  found.independent_errors = std::clamp(found.duration_s / (2.0 * found.error_lasts_s), 1.0, count);
  const double freedom = settings.place ? 1.0 : 1.0 - 1.0 / std::max(2.0, found.independent_errors);
  found.sigma_m = std::sqrt(squares / (2.0 * count * freedom));
  found.relative_error = 0.5 / std::sqrt(found.independent_errors);
  if (found.sigma_m < kLeastSigma_m) {
    throw std::runtime_error(
        "the fixes hardly scatter, as where a receiver holds its place while it stands: turn its \"static hold\" off");
  }
  return found;
}

}  // namespace urban_gnss
