#include "urban_gnss_localization/simulation/position_solution.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <limits>
#include <map>

#include "urban_gnss_localization/gnss/dilution_of_precision.hpp"

namespace urban_gnss {

std::optional<PositionSolution> solve_position(const std::vector<RangeMeasurement>& measurements,
                                               const std::optional<AltitudePrior>& prior) {
  std::map<Constellation, int> members;
  for (const RangeMeasurement& measurement : measurements) ++members[measurement.constellation];
  std::map<Constellation, int> clocks;  // the column of each
  for (const auto& [constellation, count] : members) {
    if (count > 1) clocks.emplace(constellation, static_cast<int>(clocks.size()));
  }

  PositionSolution solution;
  solution.clock_count = static_cast<int>(clocks.size());
  const int unknowns = 3 + solution.clock_count;
  Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(unknowns, unknowns);
  Eigen::VectorXd right = Eigen::VectorXd::Zero(unknowns);
  Eigen::VectorXd row(unknowns);
  const auto set_row = [&](const RangeMeasurement& measurement) {
    row.setZero();
    row.head<3>() = -measurement.line_of_sight;
    row[3 + clocks.at(measurement.constellation)] = 1.0;
  };
  std::vector<RangingSatellite> geometry;
  for (const RangeMeasurement& measurement : measurements) {
    const auto clock = clocks.find(measurement.constellation);
    solution.used.push_back(clock != clocks.end());
    if (clock == clocks.end()) continue;
    set_row(measurement);
    const double weight = 1.0 / (measurement.sigma_m * measurement.sigma_m);
    normal += weight * row * row.transpose();
    right += weight * measurement.range_m * row;
    geometry.push_back({measurement.line_of_sight, clock->second, 1.0});
  }
  solution.used_count = static_cast<int>(geometry.size());
  if (solution.used_count < unknowns) return std::nullopt;
  const auto dop = dilution_of_precision(geometry);
  if (!dop) return std::nullopt;
  solution.hdop = dop->hdop();
  solution.vdop = dop->vdop();
  if (prior) {
    const double weight = 1.0 / (prior->sigma_m * prior->sigma_m);
    normal(2, 2) += weight;
    right[2] += weight * prior->altitude_m;
  }
  const Eigen::VectorXd estimate = normal.ldlt().solve(right);
  if (!estimate.allFinite()) return std::nullopt;
  solution.position = estimate.head<3>();
  for (std::size_t i = 0; i < measurements.size(); ++i) {
    if (!solution.used[i]) {
      solution.residuals_m.push_back(std::numeric_limits<double>::quiet_NaN());
      continue;
    }
    set_row(measurements[i]);
    solution.residuals_m.push_back(measurements[i].range_m - row.dot(estimate));
  }
  return solution;
}

}  // namespace urban_gnss
