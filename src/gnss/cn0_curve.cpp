#include "urban_gnss_localization/gnss/cn0_curve.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <set>
#include <stdexcept>
#include <string>

#include "urban_gnss_localization/common/median.hpp"
#include "urban_gnss_localization/geometry/angles.hpp"
#include "urban_gnss_localization/gnss/nlos_model.hpp"

namespace urban_gnss {
namespace {

constexpr std::size_t kFewestSignals = 100;
constexpr std::size_t kFewestSatellites = 4;
/// Standard deviation of sin e below which the elevations do not tell the rise.
constexpr double kLeastSpread = 0.1;
constexpr int kIterations = 30;
/// dB; of whole dB-Hz, as most receivers report them.
constexpr double kLeastScatter_db = 0.5;
constexpr double kSigmaOfDeviation = 1.4826;
constexpr double kBand_rad = degrees_to_radians(10.0);

double quantile(std::vector<double> values, double share) {
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

std::vector<Cn0Band> bands_of(const std::vector<SatelliteObservation>& signals) {
  std::vector<Cn0Band> bands;
  for (int k = 0; k < 9; ++k) {
    Cn0Band band;
    band.from_rad = k * kBand_rad;
    band.to_rad = (k + 1) * kBand_rad;
    std::vector<double> levels;
    for (const SatelliteObservation& each : signals) {
      const double elevation = std::min(each.look.elevation_rad, 8.999 * kBand_rad);
      if (elevation >= band.from_rad && elevation < band.to_rad) levels.push_back(each.cn0_dbhz);
    }
    if (levels.empty()) continue;
    band.signals = levels.size();
    band.median_dbhz = upper_median(levels);
    band.lower_decile_dbhz = quantile(levels, 0.1);
    bands.push_back(band);
  }
  return bands;
}

}  // namespace

double Cn0Curve::odds_width_db() const { return std::max(kLeastScatter_db, scatter_db) / kQuantile; }

Cn0Curve fit_cn0_curve(const std::vector<SatelliteObservation>& all) {
  std::vector<SatelliteObservation> signals;
  std::set<SatelliteId> ids;
  for (const SatelliteObservation& each : all) {
    if (!is_received(each)) continue;
    signals.push_back(each);
    ids.insert(each.id);
  }
  if (signals.size() < kFewestSignals || ids.size() < kFewestSatellites) {
    throw std::runtime_error("C/N0: " + std::to_string(signals.size()) + " signals of " + std::to_string(ids.size()) +
                             " satellites with direction and C/N0; at least " + std::to_string(kFewestSignals) +
                             " of " + std::to_string(kFewestSatellites) + " are needed");
  }
  const auto count = static_cast<Eigen::Index>(signals.size());
  Eigen::VectorXd levels(count);
  Eigen::VectorXd sines(count);
  for (Eigen::Index i = 0; i < count; ++i) {
    levels[i] = signals[static_cast<std::size_t>(i)].cn0_dbhz;
    sines[i] =
        std::sin(signals[static_cast<std::size_t>(i)].look.elevation_rad) - std::sin(kNlosReferenceElevation_rad);
  }
  Cn0Curve curve;
  curve.signals = signals.size();
  curve.satellites = ids.size();
  curve.has_rise = std::sqrt((sines.array() - sines.mean()).square().mean()) >= kLeastSpread;
  Eigen::MatrixXd columns = Eigen::MatrixXd::Ones(count, curve.has_rise ? 2 : 1);
  if (curve.has_rise) columns.col(1) = sines;
  Eigen::VectorXd weights = Eigen::VectorXd::Ones(count);
  Eigen::VectorXd deviations;
  for (int i = 0; i < kIterations; ++i) {  // iteratively reweighted: weights of 1 / |deviation|
    const Eigen::MatrixXd weighted = weights.asDiagonal() * columns;
    const Eigen::VectorXd solution = (columns.transpose() * weighted).ldlt().solve(weighted.transpose() * levels);
    curve.level_dbhz = solution[0];
    if (curve.has_rise) curve.rise_db = solution[1];
    deviations = levels - columns * solution;
    weights = deviations.array().abs().max(kLeastScatter_db).inverse();
  }
  const Eigen::VectorXd sizes = deviations.cwiseAbs();
  curve.scatter_db =
      std::max(kLeastScatter_db, kSigmaOfDeviation * upper_median({sizes.data(), sizes.data() + sizes.size()}));
  curve.bands = bands_of(signals);
  return curve;
}

}  // namespace urban_gnss
