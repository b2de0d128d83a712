#include "urban_gnss_localization/gnss/range_geometry.hpp"

#include <map>

namespace urban_gnss {

Eigen::MatrixXd range_geometry(const std::vector<RangeDirection>& ranges) {
  std::map<Constellation, Eigen::Index> clocks;
  for (const RangeDirection& each : ranges) {
    clocks.emplace(each.clock, kFirstClockColumn + static_cast<Eigen::Index>(clocks.size()));
  }
  const Eigen::Index unknowns = kFirstClockColumn + static_cast<Eigen::Index>(clocks.size());
  Eigen::MatrixXd geometry = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(ranges.size()), unknowns);
  for (Eigen::Index i = 0; i < geometry.rows(); ++i) {
    const RangeDirection& each = ranges[static_cast<std::size_t>(i)];
    geometry.row(i).head<3>() = -each.line_of_sight;
    geometry(i, clocks.at(each.clock)) = 1.0;
  }
  return geometry;
}

}  // namespace urban_gnss
