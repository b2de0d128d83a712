#include "urban_gnss_localization/simulation/correlator.hpp"

#include <algorithm>
#include <cmath>

namespace urban_gnss {
namespace {

/// Autocorrelation of an ideal code, `delay` in chips.
double correlation(double delay) { return std::max(0.0, 1.0 - std::abs(delay)); }

/// Early minus late.
double discriminator(double delay, double spacing) {
  return correlation(delay + 0.5 * spacing) - correlation(delay - 0.5 * spacing);
}

}  // namespace

double multipath_error_m(const std::vector<Interference>& interferences, double spacing_chips) {
  double total_amplitude = 0.0;
  for (const Interference& interference : interferences) total_amplitude += interference.amplitude;
  const double scale = 1.0 / std::max(1.0, total_amplitude);
  const auto composite = [&](double delay) {
    double sum = discriminator(delay, spacing_chips);
    for (const auto& [delay_m, amplitude, phase_rad] : interferences) {
      sum += scale * amplitude * std::cos(phase_rad) * discriminator(delay - delay_m / kChip_m, spacing_chips);
    }
    return sum;
  };
  // |g| is nowhere larger than at -d/2 and d/2, where it has opposite signs: the sum has a zero between them.
  double low = -0.5 * spacing_chips;
  double high = 0.5 * spacing_chips;
  constexpr int kSteps = 30;  // 0.3 um of a chip
  for (int step = 0; step < kSteps; ++step) {
    const double middle = 0.5 * (low + high);
    (composite(middle) < 0.0 ? high : low) = middle;
  }
  return 0.5 * (low + high) * kChip_m;
}

double code_noise_sigma_m(double cn0_dbhz, double bandwidth_hz, double spacing_chips, double integration_time_s) {
  const double cn0_hz = std::pow(10.0, 0.1 * cn0_dbhz);
  const double squaring_loss = 1.0 + 2.0 / ((2.0 - spacing_chips) * integration_time_s * cn0_hz);
  return kChip_m * std::sqrt(0.5 * bandwidth_hz * spacing_chips / cn0_hz * squaring_loss);
}

}  // namespace urban_gnss
