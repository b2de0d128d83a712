#include "urban_gnss_localization/gnss/residual_check.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "urban_gnss_localization/common/median.hpp"
#include "urban_gnss_localization/gnss/range_geometry.hpp"

namespace urban_gnss {
namespace {

constexpr std::size_t kEpochs = 60;
constexpr std::size_t kLeastEpochs = 20;
constexpr std::size_t kLeastSpare = 2;
constexpr double kBelievedAgain = 2.0 / 3.0;
constexpr double kLeastSine = 0.05;  ///< of an elevation, for the weights
constexpr double kCn0Unknown_dbhz = 35.0;
constexpr double kCn0Min_dbhz = 15.0;
constexpr double kCn0Max_dbhz = 55.0;

struct UsedRange {
  std::size_t clock;
  Eigen::Vector3d line_of_sight;
  double residual_m;
  double by_elevation;  ///< weights
  double by_cn0;
};

/// Share of the weighted residuals that place and clocks explain; nothing where there are no residuals.
template <class WeightOf>
std::optional<double> explained_share(const std::vector<UsedRange>& ranges, const WeightOf& weight_of) {
  ClockMeans clocks;
  double all = 0.0;
  for (const UsedRange& range : ranges) {
    const double weight = weight_of(range);
    all += weight * range.residual_m * range.residual_m;
    clocks.add(range.clock, weight, range.residual_m, range.line_of_sight);
  }
  if (!(all > 0.0) || !std::isfinite(all)) return std::nullopt;
  clocks.finish();
  using Columns = Eigen::Matrix<double, Eigen::Dynamic, 3>;
  Columns geometry(ranges.size(), 3);
  Eigen::VectorXd left(ranges.size());
  for (Eigen::Index i = 0; i < left.size(); ++i) {
    const UsedRange& range = ranges[static_cast<std::size_t>(i)];
    const ClockMeans::Mean& clock = clocks.of(range.clock);
    const double root = std::sqrt(weight_of(range));
    geometry.row(i) = root * (range.line_of_sight - clock.line_of_sight).transpose();
    left[i] = root * (range.residual_m - clock.residual_m);
  }
  const Eigen::ColPivHouseholderQR<Columns> factors(geometry);
  left.applyOnTheLeft(factors.householderQ().adjoint());
  return (clocks.explained_m2() + left.head(factors.rank()).squaredNorm()) / all;
}

}  // namespace

std::optional<double> residual_misfit(const std::vector<SatelliteObservation>& satellites) {
  std::vector<UsedRange> ranges;
  ranges.reserve(satellites.size());
  ClockMeans clocks;
  for (const SatelliteObservation& each : satellites) {
    if (!has_direction(each) || !each.tracked || !std::isfinite(each.residual_m)) continue;
    const double cn0_dbhz = has_cn0(each) ? each.cn0_dbhz : kCn0Unknown_dbhz;
    ranges.push_back({clock_number(each.id.constellation), line_of_sight(each.look), each.residual_m,
                      std::pow(std::max(std::sin(each.look.elevation_rad), kLeastSine), 2),
                      std::pow(10.0, (std::clamp(cn0_dbhz, kCn0Min_dbhz, kCn0Max_dbhz) - kCn0Unknown_dbhz) / 10.0)});
    clocks.add(ranges.back().clock, 1.0, each.residual_m, ranges.back().line_of_sight);
  }
  const std::size_t unknowns = 3 + clocks.count();
  if (ranges.size() < unknowns + kLeastSpare) return std::nullopt;
  std::optional<double> least;
  const auto try_weights = [&](const auto& weight_of) {
    const auto share = explained_share(ranges, weight_of);
    if (share) least = std::min(least.value_or(*share), *share);
  };
  try_weights([](const UsedRange&) { return 1.0; });
  try_weights([](const UsedRange& range) { return range.by_elevation; });
  try_weights([](const UsedRange& range) { return range.by_cn0; });
  try_weights([](const UsedRange& range) { return range.by_elevation * range.by_cn0; });
  if (!least) return std::nullopt;
  return *least * static_cast<double>(ranges.size()) / static_cast<double>(unknowns);
}

void ResidualCheck::add(const std::vector<SatelliteObservation>& satellites) {
  const auto misfit = residual_misfit(satellites);
  if (!misfit) return;
  misfits_.push_back(*misfit);
  if (misfits_.size() > kEpochs) misfits_.pop_front();
  if (misfits_.size() < kLeastEpochs) return;
  const double usual = upper_median(std::vector<double>(misfits_.begin(), misfits_.end()));
  belong_ = usual <= parameters_.residual_misfit_limit * (belong_ ? 1.0 : kBelievedAgain);
}

}  // namespace urban_gnss
