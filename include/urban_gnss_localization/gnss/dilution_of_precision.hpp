#pragma once

#include <Eigen/Core>
#include <cmath>
#include <optional>
#include <vector>

namespace urban_gnss {

/// What one satellite contributes to the geometry of a fix.
struct RangingSatellite {
  Eigen::Vector3d line_of_sight{Eigen::Vector3d::Zero()};  ///< unit vector to the satellite (east, north, up)
  int clock{0};                                            ///< label; each distinct one is a clock offset to estimate
  double weight{1.0};  ///< variance of a range of weight 1 over that of this range; 0 leaves the satellite out
};

/// How an error of the ranges of standard deviation 1 (of weight 1) spreads over the position.
struct DilutionOfPrecision {
  Eigen::Matrix3d position;  ///< the position's block of M = (H^T W H)^-1 (east, north, up), without unit

  Eigen::Matrix2d horizontal() const { return position.topLeftCorner<2, 2>(); }
  double hdop() const { return std::sqrt(position(0, 0) + position(1, 1)); }
  double vdop() const { return std::sqrt(position(2, 2)); }
  double pdop() const { return std::sqrt(position.trace()); }
};

/// Maier and Kleiner 2010, Algorithm 1, with weights W and one clock column for each distinct `clock`: H has a row
/// (line of sight, 0..1..0) for each satellite. The paper's sign of the line of sight (a linearised range has the
/// opposite one) does not matter: it flips three columns of H, which leaves the position's block of M as it is.
///
/// The clock columns are eliminated first, so that what is inverted is the 3x3 matrix
///   S = sum over clocks c, satellites i of c: w_i (a_i - m_c)(a_i - m_c)^T,  m_c = weighted mean of the a_i of c,
/// the Schur complement of the clocks in H^T W H; its inverse is the position's block of M.
///
/// Empty where the position is not determined: fewer satellites than unknowns (3 and the clocks), or a geometry whose S
/// has an eigenvalue below 1e-10 of the sum of the weights (all lines of sight on one cone, say). A satellite whose
/// line of sight or weight is not finite, or whose weight is not positive, is left out. Requires unit vectors. Never
/// throws.
std::optional<DilutionOfPrecision> dilution_of_precision(const std::vector<RangingSatellite>& satellites);

/// The same with weight 1 and one clock for all: Algorithm 1 as printed.
std::optional<DilutionOfPrecision> dilution_of_precision(const std::vector<Eigen::Vector3d>& lines_of_sight);

/// Covariance of the fix in the horizontal plane (east, north), m^2: the paper's conventional model, eq. (4), for the
/// DOP of all satellites that the receiver uses, and its improved model, eq. (6), for that of the visible ones.
/// `sigma_ure_m` is the standard deviation of a range of weight 1 (3.75 m in the paper).
Eigen::Matrix2d horizontal_covariance(const DilutionOfPrecision& dop, double sigma_ure_m);

}  // namespace urban_gnss
