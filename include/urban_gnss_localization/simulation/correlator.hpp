#pragma once

#include <vector>

namespace urban_gnss {

/// Length of a chip of the C/A code (1.023 MHz), m. The same is taken for Galileo's E1.
inline constexpr double kChip_m = 299792458.0 / 1.023e6;

/// A signal that arrives beside the one that is tracked.
struct Interference {
  double delay_m{0.0};    ///< against the tracked signal; negative where it arrives earlier
  double amplitude{0.0};  ///< against the tracked signal, >= 0
  double phase_rad{0.0};  ///< of the carrier against the tracked signal's
};

/// Where a coherent early-late delay lock loop of spacing d = `spacing_chips` in (0, 1] settles against the tracked
/// signal, m: the zero of D(t) = g(t) + sum_i a_i cos(phi_i) g(t - delay_i) with g(t) = R(t + d/2) - R(t - d/2), R the
/// triangular autocorrelation of an ideal C/A code (Kaplan & Hegarty, Understanding GPS, 2nd ed., section 6.3; Braasch
/// in Parkinson & Spilker, Global Positioning System, vol. I, ch. 14). For one interference this is the known envelope:
/// at most a d/2 chips.
///
/// Where the interferences together are stronger than the tracked signal their amplitudes are scaled to its own, so
/// that the error is never beyond half the spacing, i.e. never beyond half a chip.
double multipath_error_m(const std::vector<Interference>& interferences, double spacing_chips);

/// Standard deviation of the thermal noise of a non-coherent early-late loop with a wide front end, m (Kaplan &
/// Hegarty, 2nd ed., eq. 5.23): chip sqrt(B d / (2 C/N0) (1 + 2 / ((2 - d) T C/N0))), B the loop's noise bandwidth in
/// Hz, d the spacing in chips, T the integration time in s.
double code_noise_sigma_m(double cn0_dbhz, double bandwidth_hz, double spacing_chips, double integration_time_s);

}  // namespace urban_gnss
