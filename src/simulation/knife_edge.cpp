#include "urban_gnss_localization/simulation/knife_edge.hpp"

#include <cmath>
#include <limits>

namespace urban_gnss {

KnifeEdge knife_edge(double distance_m, double height_m, double elevation_rad) {
  const double cosine = std::cos(elevation_rad);
  const double sine = std::sin(elevation_rad);
  const double above_m = height_m * cosine - distance_m * sine;  // the edge's distance from the line of sight
  const double foot_m = distance_m * cosine + height_m * sine;
  if (!(foot_m > 0.0)) return {-std::numeric_limits<double>::infinity(), 0.0};
  // hypot(foot, above) - foot without its cancellation
  const double excess_m = above_m * above_m / (std::hypot(foot_m, above_m) + foot_m);
  return {above_m * std::sqrt(2.0 / (kL1Wavelength_m * foot_m)), excess_m};
}

double knife_edge_loss_db(double parameter) {
  if (!(parameter > kClearOfEdge)) return 0.0;
  const double shifted = parameter - 0.1;
  return 6.9 + 20.0 * std::log10(std::sqrt(shifted * shifted + 1.0) + shifted);
}

}  // namespace urban_gnss
