#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>

#include "float4.hpp"

namespace urban_gnss {

/// Points about a stretch of a ray, seen along it.
class RayNeighbourhood {
 public:
  /// As many as a mask has bits.
  static constexpr std::size_t kCapacity = 64;

  void clear() { count_ = 0; }

  /// `across` (m) in the plane normal to the ray, which is the origin there; `along_m` along the ray. Where there is
  /// no room the point farthest from the ray gives way.
  void add(const float* point, float across_x, float across_y, float along_m) {
    std::size_t slot = count_;
    if (count_ == kCapacity) {
      slot = farthest();
      if (squared_distance(slot) <= across_x * across_x + across_y * across_y) return;
    } else {
      ++count_;
    }
    across_x_[slot] = across_x;
    across_y_[slot] = across_y;
    x_[slot] = point[0];
    y_[slot] = point[1];
    z_[slot] = point[2];
    along_m_[slot] = along_m;
  }

  /// Whether the ray pierces a triangle of points mutually within `link_m`; sets the range at which it does.
  bool pierced(float link_m, double& range_m) {
    if (count_ < 3) return false;
    for (Row* row : {&across_x_, &across_y_, &x_, &y_, &z_}) store4(row->data() + count_, Float4{});
    if (!is_on_both_sides()) return false;
    const float squared_link = link_m * link_m;
    std::array<Relations, kCapacity> of;
    std::uint64_t is_known = 0;  // of which points the relations are: mostly few are needed
    const auto relations = [&](std::size_t i) -> const Relations& {
      const std::uint64_t bit = std::uint64_t{1} << i;
      if ((is_known & bit) == 0) of[i] = relations_of(i, squared_link);
      is_known |= bit;
      return of[i];
    };
    for (std::size_t i = 0; i < count_; ++i) {
      const Relations of_i = relations(i);
      for (std::uint64_t rest = of_i.left; rest != 0; rest &= rest - 1) {
        const auto j = static_cast<std::size_t>(__builtin_ctzll(rest));
        // k is left of j, and i is left of k.
        const std::uint64_t third = of_i.linked & relations(j).left & ~of_i.left;
        if (third == 0) continue;
        const auto k = static_cast<std::size_t>(__builtin_ctzll(third));
        range_m = crossing_m(i, j, k);
        return true;
      }
    }
    return false;
  }

 private:
  using Row = std::array<float, kCapacity + 4>;  ///< four are read at a time

  float squared_distance(std::size_t i) const { return across_x_[i] * across_x_[i] + across_y_[i] * across_y_[i]; }
  float cross(std::size_t i, std::size_t j) const { return across_x_[i] * across_y_[j] - across_y_[i] * across_x_[j]; }

  std::size_t farthest() const {
    std::size_t slot = 0;
    for (std::size_t i = 1; i < count_; ++i) {
      if (squared_distance(i) > squared_distance(slot)) slot = i;
    }
    return slot;
  }

  /// Whether some are above and some below the ray, and some left and some right of it: else it can pierce nothing.
  bool is_on_both_sides() const {
    Mask4 is_right{};
    Mask4 is_left{};
    Mask4 is_above{};
    Mask4 is_below{};
    for (std::size_t i = 0; i < count_; i += 4) {
      const Float4 x = load4(across_x_.data() + i);
      const Float4 y = load4(across_y_.data() + i);
      is_right |= x > 0.0F;
      is_left |= x < 0.0F;
      is_above |= y > 0.0F;
      is_below |= y < 0.0F;
    }
    const auto any = [](Mask4 mask) { return bits_of(mask) != 0 ? 1U : 0U; };
    return (any(is_right) & any(is_left) & any(is_above) & any(is_below)) != 0;
  }

  /// The points linked to one, and those of them that are less than 180 degrees to its left; of two in one line with
  /// the ray, the earlier.
  struct Relations {
    std::uint64_t linked;
    std::uint64_t left;
  };
  Relations relations_of(std::size_t i, float squared_link) const {
    std::uint64_t linked = 0;
    std::uint64_t is_left = 0;
    std::uint64_t is_not_right = 0;
    for (std::size_t j = 0; j < count_; j += 4) {
      const Float4 dx = load4(x_.data() + j) - x_[i];
      const Float4 dy = load4(y_.data() + j) - y_[i];
      const Float4 dz = load4(z_.data() + j) - z_[i];
      const Float4 ahead = across_x_[i] * load4(across_y_.data() + j);
      const Float4 behind = across_y_[i] * load4(across_x_.data() + j);
      linked |= std::uint64_t{bits_of(dx * dx + (dy * dy + dz * dz) <= squared_link)} << j;
      is_left |= std::uint64_t{bits_of(ahead > behind)} << j;
      is_not_right |= std::uint64_t{bits_of(ahead >= behind)} << j;
    }
    const std::uint64_t bit = std::uint64_t{1} << i;
    const std::uint64_t present = ~std::uint64_t{0} >> (kCapacity - count_);
    linked &= present & ~bit;
    return {linked, linked & (is_left | (is_not_right & (bit - 1)))};
  }

  /// By the barycentric coordinates of the origin.
  double crossing_m(std::size_t i, std::size_t j, std::size_t k) const {
    const float wi = cross(j, k);
    const float wj = cross(k, i);
    const float wk = cross(i, j);
    return (wi * along_m_[i] + wj * along_m_[j] + wk * along_m_[k]) / (wi + wj + wk);
  }

  std::size_t count_{0};
  Row across_x_;
  Row across_y_;
  Row x_;
  Row y_;
  Row z_;
  Row along_m_;
};

}  // namespace urban_gnss
