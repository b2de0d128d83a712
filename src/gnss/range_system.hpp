#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "urban_gnss_localization/common/quad.hpp"
#include "urban_gnss_localization/gnss/range_fix.hpp"
#include "urban_gnss_localization/gnss/range_geometry.hpp"

namespace urban_gnss {

/// Four ranges of one clock, side by side.
struct RangeQuad {
  Quad line_of_sight[3]{};
  Quad residual_m{};
  Quad nlos_mean_m{};  ///< excess, if it is NLOS
  Quad nlos_variance_m2{1.0, 1.0, 1.0, 1.0};
  Quad log_odds_before{};  ///< of NLOS, by C/N0
  Quad is_range{};         ///< 1; 0 where a clock has no more
  // As judged and weighed in the last round.
  Quad nlos_probability{};
  Quad corrected_m{};
  Quad weight{};
};

/// The ranges of a fix, by their clocks.
struct ClockedRanges {
  std::vector<RangeQuad> quads;
  std::array<std::size_t, kMostClocks + 1> first{};  ///< of each clock's quads; then their number
};

/// The antenna's place by ranges that are each NLOS with a probability, which range_fix() describes: least squares for
/// place, height and clocks. A clock is the mean of its ranges, by which it is eliminated: what is left are three
/// unknowns.
RelativePlace solve_ranges(ClockedRanges& ranges, const RelativePlace& known, const RangeFixParameters& parameters);

}  // namespace urban_gnss
