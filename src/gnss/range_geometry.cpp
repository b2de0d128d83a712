#include "urban_gnss_localization/gnss/range_geometry.hpp"

#include <algorithm>

namespace urban_gnss {

std::size_t clock_number(Constellation constellation) {
  return std::min(static_cast<std::size_t>(clock_of(constellation)), kMostClocks - 1);
}

void ClockMeans::add(std::size_t clock, double weight, double residual_m, const Eigen::Vector3d& line_of_sight) {
  Mean& mean = means_[clock];
  mean.weight += weight;
  mean.residual_m += weight * residual_m;
  mean.line_of_sight += weight * line_of_sight;
}

void ClockMeans::finish() {
  for (Mean& mean : means_) {
    if (!(mean.weight > 0.0)) continue;
    mean.residual_m /= mean.weight;
    mean.line_of_sight /= mean.weight;
  }
}

std::size_t ClockMeans::count() const {
  return static_cast<std::size_t>(
      std::count_if(means_.begin(), means_.end(), [](const Mean& mean) { return mean.weight > 0.0; }));
}

double ClockMeans::explained_m2() const {
  double sum = 0.0;
  for (const Mean& mean : means_) sum += mean.weight * mean.residual_m * mean.residual_m;
  return sum;
}

}  // namespace urban_gnss
