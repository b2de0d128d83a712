#include "urban_gnss_localization/gnss/range_fix.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>

#include "range_system.hpp"
#include "urban_gnss_localization/common/positive_definite.hpp"

namespace urban_gnss {
namespace {

constexpr double kMostCertain = 0.98;
constexpr double kLeastSigma_m = 1e-3;
constexpr double kMaxResidual_m = 1e5;  ///< beyond it, a driver's invention

/// The ranges that can be used, one of each satellite.
ClockedRanges ranges_of(const std::vector<SatelliteObservation>& satellites, double nominal_cn0_dbhz,
                        const RangeFixParameters& p) {
  std::vector<const SatelliteObservation*> usable;
  usable.reserve(satellites.size());
  for (const SatelliteObservation& each : satellites) {
    if (is_received(each) && std::abs(each.residual_m) <= kMaxResidual_m) usable.push_back(&each);
  }
  // One signal of each satellite, the first.
  std::sort(usable.begin(), usable.end(), [](const SatelliteObservation* a, const SatelliteObservation* b) {
    return a->id != b->id ? a->id < b->id : a < b;
  });
  usable.erase(std::unique(usable.begin(), usable.end(),
                           [](const SatelliteObservation* a, const SatelliteObservation* b) { return a->id == b->id; }),
               usable.end());
  std::array<std::size_t, kMostClocks> sharing{};
  for (const SatelliteObservation* each : usable) ++sharing[clock_number(each->id.constellation)];
  ClockedRanges ranges;
  std::array<std::size_t, kMostClocks> next{};  // place of each clock's next range
  for (std::size_t clock = 0; clock < kMostClocks; ++clock) {
    const std::size_t first = ranges.first[clock];
    next[clock] = 4 * first;
    ranges.first[clock + 1] = first + (sharing[clock] < 2 ? 0 : (sharing[clock] + 3) / 4);
  }
  ranges.quads.resize(ranges.first[kMostClocks]);
  const double most_log_odds = log_odds(kMostCertain);
  for (const SatelliteObservation* observation : usable) {
    const SatelliteObservation& each = *observation;
    const std::size_t clock = clock_number(each.id.constellation);
    if (sharing[clock] < 2) continue;  // alone, it only tells its clock
    RangeQuad& quad = ranges.quads[next[clock] / 4];
    const int lane = static_cast<int>(next[clock]++ % 4);
    const Eigen::Vector3d towards = line_of_sight(each.look);
    for (int k = 0; k < 3; ++k) quad.line_of_sight[k][lane] = towards[k];
    quad.residual_m[lane] = each.residual_m;
    const NlosRange nlos = nlos_range(each.look.elevation_rad, p.nlos);
    quad.nlos_mean_m[lane] = nlos.mean_m;
    quad.nlos_variance_m2[lane] = nlos.sigma_m * nlos.sigma_m;
    const double weaker_db = nominal_cn0_dbhz - levelled_cn0_dbhz(each, p.nlos);
    quad.log_odds_before[lane] =
        std::clamp(nlos_log_odds(weaker_db - p.nlos_cn0_drop, p.nlos), -most_log_odds, most_log_odds);
    quad.is_range[lane] = 1.0;
  }
  return ranges;
}

}  // namespace

std::optional<RelativePlace> range_fix(const std::vector<SatelliteObservation>& satellites, double nominal_cn0_dbhz,
                                       const RelativePlace& known, const RangeFixParameters& parameters) {
  ClockedRanges ranges = ranges_of(satellites, nominal_cn0_dbhz, parameters);
  if (ranges.quads.empty()) return std::nullopt;
  RelativePlace certain = known;  // never wholly, so that it can be inverted
  certain.covariance.diagonal().array() += kLeastSigma_m * kLeastSigma_m;
  const RelativePlace place = solve_ranges(ranges, certain, parameters);
  // Ranges of micrometres leave nothing but rounding errors of a direction of which they say nothing.
  if (!place.offset.allFinite() || !is_positive_definite(place.covariance)) return std::nullopt;
  return place;
}

}  // namespace urban_gnss
