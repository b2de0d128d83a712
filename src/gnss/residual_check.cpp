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
constexpr Eigen::Index kLeastSpare = 2;
constexpr double kBelievedAgain = 2.0 / 3.0;
constexpr double kLeastSine = 0.05;  ///< of an elevation, for the weights
constexpr double kCn0Unknown_dbhz = 35.0;
constexpr double kCn0Min_dbhz = 15.0;
constexpr double kCn0Max_dbhz = 55.0;

/// Share of the weighted residuals that the columns of the geometry explain; nothing where there are no residuals.
std::optional<double> explained_share(const Eigen::MatrixXd& geometry, const Eigen::VectorXd& residuals_m,
                                      const Eigen::VectorXd& weights) {
  const Eigen::VectorXd root = weights.cwiseSqrt();
  const Eigen::VectorXd weighted = root.asDiagonal() * residuals_m;
  const double all = weighted.squaredNorm();
  if (!(all > 0.0) || !std::isfinite(all)) return std::nullopt;
  const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> factors(root.asDiagonal() * geometry);
  const Eigen::VectorXd turned = factors.householderQ().transpose() * weighted;
  return turned.head(factors.rank()).squaredNorm() / all;
}

}  // namespace

std::optional<double> residual_misfit(const std::vector<SatelliteObservation>& satellites) {
  std::vector<RangeDirection> ranges;
  std::vector<const SatelliteObservation*> used;
  for (const SatelliteObservation& each : satellites) {
    if (!has_direction(each) || !each.tracked || !std::isfinite(each.residual_m)) continue;
    ranges.push_back({clock_of(each.id.constellation), line_of_sight(each.look)});
    used.push_back(&each);
  }
  const Eigen::MatrixXd geometry = range_geometry(ranges);
  if (geometry.rows() < geometry.cols() + kLeastSpare) return std::nullopt;

  Eigen::VectorXd residuals_m(geometry.rows());
  Eigen::VectorXd by_elevation(geometry.rows());
  Eigen::VectorXd by_cn0(geometry.rows());
  for (Eigen::Index i = 0; i < geometry.rows(); ++i) {
    const SatelliteObservation& each = *used[static_cast<std::size_t>(i)];
    residuals_m[i] = each.residual_m;
    by_elevation[i] = std::pow(std::max(std::sin(each.look.elevation_rad), kLeastSine), 2);
    const double cn0_dbhz = has_cn0(each) ? each.cn0_dbhz : kCn0Unknown_dbhz;
    by_cn0[i] = std::pow(10.0, (std::clamp(cn0_dbhz, kCn0Min_dbhz, kCn0Max_dbhz) - kCn0Unknown_dbhz) / 10.0);
  }
  const Eigen::VectorXd equal = Eigen::VectorXd::Ones(geometry.rows());
  std::optional<double> least;
  for (const Eigen::VectorXd& weights :
       {equal, by_elevation, by_cn0, Eigen::VectorXd(by_elevation.cwiseProduct(by_cn0))}) {
    const auto share = explained_share(geometry, residuals_m, weights);
    if (share) least = std::min(least.value_or(*share), *share);
  }
  if (!least) return std::nullopt;
  return *least * static_cast<double>(geometry.rows()) / static_cast<double>(geometry.cols());
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
