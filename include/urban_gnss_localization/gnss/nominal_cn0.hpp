#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "urban_gnss_localization/gnss/nlos_model.hpp"

namespace urban_gnss {

/// Nominal C/N0 of a receiver: that of its signals in line of sight at 37 degrees elevation, taken as the upper decile
/// of all so far. It differs by tens of dB between antennas and receivers.
class NominalCn0 {
 public:
  /// Leaves out satellites that are not is_received().
  void add(const std::vector<SatelliteObservation>& satellites, const NlosParameters& parameters);
  /// dB-Hz; nothing before the first signal.
  std::optional<double> dbhz() const;
  void reset() { *this = {}; }

 private:
  static constexpr std::size_t kBins = 80;
  std::array<std::uint32_t, kBins> counts_{};  ///< of signals, by dB-Hz
  std::uint32_t total_{0};
};

}  // namespace urban_gnss
