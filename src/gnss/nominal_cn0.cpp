#include "urban_gnss_localization/gnss/nominal_cn0.hpp"

#include <algorithm>
#include <cmath>

namespace urban_gnss {

void NominalCn0::add(const std::vector<SatelliteObservation>& satellites, const NlosParameters& parameters) {
  for (const SatelliteObservation& each : satellites) {
    if (!is_received(each)) continue;
    const double level = std::clamp(std::round(levelled_cn0_dbhz(each, parameters)), 0.0, kBins - 1.0);
    ++counts_[static_cast<std::size_t>(level)];
    ++total_;
  }
}

std::optional<double> NominalCn0::dbhz() const {
  constexpr double kQuantile = 0.9;
  if (total_ == 0) return std::nullopt;
  double below = 0.0;
  for (std::size_t bin = 0; bin < kBins; ++bin) {
    below += counts_[bin];
    if (below >= kQuantile * total_) return static_cast<double>(bin);
  }
  return kBins - 1.0;
}

}  // namespace urban_gnss
