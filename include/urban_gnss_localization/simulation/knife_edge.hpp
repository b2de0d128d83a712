#pragma once

namespace urban_gnss {

/// Wavelength of GPS L1 and Galileo E1 (1575.42 MHz), m.
inline constexpr double kL1Wavelength_m = 299792458.0 / 1575.42e6;

/// The diffraction parameter from which the loss of an edge is taken as zero (ITU-R P.526, section 4.1).
inline constexpr double kClearOfEdge = -0.78;

/// A horizontal edge between an antenna and a satellite, in the vertical plane of the line of sight.
struct KnifeEdge {
  double parameter{0.0};  ///< v; positive where the edge is above the line of sight
  double excess_m{0.0};   ///< of the way over the edge against the line of sight, >= 0
};

/// The edge at the horizontal distance `distance_m` > 0 and `height_m` above the antenna, seen against a satellite at
/// `elevation_rad` in (0, pi/2). ITU-R P.526 eq. (26) with the source at infinity: v = h sqrt(2 / (lambda d1)), h the
/// edge's distance from the line of sight (positive above it), d1 the way from the antenna to the foot of h. The excess
/// is that of a plane wave: the way from the edge to the antenna minus its projection on the line of sight. An edge
/// behind the antenna as seen from the satellite (d1 <= 0, deep below a steep ray) counts as far clear of it.
KnifeEdge knife_edge(double distance_m, double height_m, double elevation_rad);

/// ITU-R P.526 eq. (31): J(v), dB, zero where v <= kClearOfEdge. An edge that just touches the line of sight (v = 0)
/// takes 6 dB.
double knife_edge_loss_db(double parameter);

}  // namespace urban_gnss
