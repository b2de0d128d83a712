#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

#include "urban_gnss_localization/occlusion/voxel_walk.hpp"

/// Bit masks of the voxels of a VoxelMap's cell, and of the cells of its brick: 4 x 4 x 4 places each.
namespace urban_gnss::cell_bits {

inline constexpr int kSide = 4;
inline constexpr std::uint32_t kPlaces = 64;

/// The bit of a neighbour, or of the cell itself, among the 27 cells about one.
inline std::uint32_t nearby_bit(int dx, int dy, int dz) {
  return 1U << static_cast<unsigned>(9 * (dx + 1) + 3 * (dy + 1) + dz + 1);
}

/// The place of a cell in its brick, and of a voxel in its cell: octant by octant, so that neighbours are close.
inline std::uint32_t place_of(const VoxelCoordinates& at) {
  const int place = (at.x() & 1) | (at.y() & 1) << 1 | (at.z() & 1) << 2 |  //
                    (at.x() & 2) << 2 | (at.y() & 2) << 3 | (at.z() & 2) << 4;
  return static_cast<std::uint32_t>(place);
}

/// The coordinates of a voxel's cell, or of a cell's brick; rounds down below zero, too.
inline VoxelCoordinates parent_of(const VoxelCoordinates& at) { return {at.x() >> 2, at.y() >> 2, at.z() >> 2}; }

inline std::uint64_t bit_of(const VoxelCoordinates& voxel) { return std::uint64_t{1} << place_of(voxel); }
/// The coordinates in the brick, or in the cell, of this place.
inline VoxelCoordinates at_place(std::uint32_t place) {
  const auto bits = [place](unsigned axis) {
    return static_cast<int>((place >> axis & 1U) | (place >> axis >> 2U & 2U));
  };
  return {bits(0), bits(1), bits(2)};
}

/// How many of a cell's voxels come before this one: the number of bits below it, in the registers of any machine.
inline std::uint32_t rank(std::uint64_t mask, std::uint64_t bit) {
  std::uint64_t below = mask & (bit - 1);
  below -= below >> 1U & 0x5555555555555555U;
  below = (below & 0x3333333333333333U) + (below >> 2U & 0x3333333333333333U);
  below = (below + (below >> 4U)) & 0x0F0F0F0F0F0F0F0FU;
  return static_cast<std::uint32_t>(below * 0x0101010101010101U >> 56U);
}

/// For each axis the bits of a cell's voxels from the first, second, third or fourth on, or of none.
inline constexpr std::array<std::array<std::uint64_t, kSide + 1>, 3> kFrom{{
    {~0ULL, 0xFFAAFFAAFFAAFFAAU, 0xFF00FF00FF00FF00U, 0xAA00AA00AA00AA00U, 0U},
    {~0ULL, 0xFFFFCCCCFFFFCCCCU, 0xFFFF0000FFFF0000U, 0xCCCC0000CCCC0000U, 0U},
    {~0ULL, 0xFFFFFFFFF0F0F0F0U, 0xFFFFFFFF00000000U, 0xF0F0F0F000000000U, 0U},
}};
/// The bits of the voxels that are from `low` to `high` along one axis, of a cell with this coordinate along it.
inline std::uint64_t slab(std::size_t axis, int cell, int low, int high) {
  const auto from = [&](int voxel) {
    return kFrom[axis][static_cast<std::size_t>(std::min(std::max(voxel - kSide * cell, 0), kSide))];
  };
  return from(low) & ~from(high + 1);
}

/// For each axis the nearby_bit()s of the nine cells on its low side, in its middle and on its high side.
inline constexpr std::array<std::array<std::uint32_t, 3>, 3> kNearbyAlong{{
    {0x00001FFU, 0x003FE00U, 0x7FC0000U},
    {0x01C0E07U, 0x0E07038U, 0x70381C0U},
    {0x1249249U, 0x2492492U, 0x4924924U},
}};

/// For each axis, the bits of a cell's voxels that are at these of the four coordinates along it, one bit each.
inline constexpr std::array<std::array<std::uint64_t, 16>, 3> kSlabOf = [] {
  std::array<std::array<std::uint64_t, 16>, 3> slabs{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (std::size_t coordinates = 0; coordinates < 16; ++coordinates) {
      for (std::size_t at = 0; at < kSide; ++at) {
        if ((coordinates >> at & 1U) != 0) slabs[axis][coordinates] |= kFrom[axis][at] & ~kFrom[axis][at + 1];
      }
    }
  }
  return slabs;
}();

/// A bit for each of the twelve coordinates along one axis of a cell with this coordinate and of its two neighbours: 1
/// from `low` to `high`, both included. `high` is not below the cell's low neighbour.
inline std::uint32_t nearby_range(int cell, int low, int high) {
  const int first = std::max(low - kSide * (cell - 1), 0);
  const int last = std::min(high - kSide * (cell - 1), 3 * kSide - 1);
  return (2U << static_cast<unsigned>(last)) - (1U << static_cast<unsigned>(first));
}

/// The nearby_bit()s of the cells that a nearby_range() along this axis touches.
inline std::uint32_t nearby_of_range(std::size_t axis, std::uint32_t range) {
  return ((range & 0x00FU) != 0 ? kNearbyAlong[axis][0] : 0U) | ((range & 0x0F0U) != 0 ? kNearbyAlong[axis][1] : 0U) |
         ((range & 0xF00U) != 0 ? kNearbyAlong[axis][2] : 0U);
}

/// For each nearby_bit(), from the lowest on, the sides of the three axes: 0, 1 or 2.
inline constexpr std::array<std::array<std::uint8_t, 3>, 27> kNearbySides = [] {
  std::array<std::array<std::uint8_t, 3>, 27> sides{};
  for (std::size_t i = 0; i < 27; ++i) {
    sides[i][0] = static_cast<std::uint8_t>(i / 9);
    sides[i][1] = static_cast<std::uint8_t>(i / 3 % 3);
    sides[i][2] = static_cast<std::uint8_t>(i % 3);
  }
  return sides;
}();

/// For each place in a brick and each nearby_bit() the neighbour's place in its brick, plus kPlaces times the sum of 1,
/// 2 and 4 where that is another brick along x, y and z.
inline constexpr std::array<std::array<std::uint16_t, 27>, kPlaces> kNeighbours = [] {
  std::array<std::array<std::uint16_t, 27>, kPlaces> neighbours{};
  for (std::uint32_t place = 0; place < kPlaces; ++place) {
    for (std::size_t i = 0; i < 27; ++i) {
      std::uint32_t neighbour = 0;
      for (std::uint32_t axis = 0; axis < 3; ++axis) {
        const std::uint32_t from = (place >> axis & 1U) | (place >> axis >> 2U & 2U);
        const std::uint32_t to = from + kNearbySides[i][axis] + 3;  // of two bricks' eight cells, shifted by four
        neighbour |= ((to & 1U) | (to & 2U) << 2U) << axis | (to < 4 || to > 7 ? kPlaces << axis : 0U);
      }
      neighbours[place][i] = static_cast<std::uint16_t>(neighbour);
    }
  }
  return neighbours;
}();

}  // namespace urban_gnss::cell_bits
