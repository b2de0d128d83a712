#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>

#include "urban_gnss_localization/gnss/satellite.hpp"

namespace urban_gnss {

/// The receiver's clocks: those of the constellations, and one of whatever has another number.
inline constexpr std::size_t kMostClocks = static_cast<std::size_t>(Constellation::kNavic) + 2;
/// By clock_of(), below kMostClocks.
std::size_t clock_number(Constellation constellation);

/// Weighted means of the ranges that share a clock. A range changes with the antenna's place (m, east, north, up) by
/// -(line of sight), and by 1 with its clock (m). Least squares of place and clocks are those of the place alone, of
/// what each range is apart from the means.
class ClockMeans {
 public:
  struct Mean {
    double weight{0.0};  ///< the sum
    double residual_m{0.0};
    Eigen::Vector3d line_of_sight{Eigen::Vector3d::Zero()};
  };

  void add(std::size_t clock, double weight, double residual_m, const Eigen::Vector3d& line_of_sight);
  /// After the last: makes means of the sums.
  void finish();
  const Mean& of(std::size_t clock) const { return means_[clock]; }
  /// Clocks that have a range.
  std::size_t count() const;
  /// Sum of weight times squared mean residual: what the clocks alone explain of the residuals, m^2.
  double explained_m2() const;

 private:
  std::array<Mean, kMostClocks> means_;
};

}  // namespace urban_gnss
