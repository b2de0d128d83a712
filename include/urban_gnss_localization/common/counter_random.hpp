#pragma once

#include <array>
#include <cstdint>

#include "urban_gnss_localization/common/vector_math.hpp"

namespace urban_gnss {

/// Four independent random words.
using RandomWords = std::array<std::uint32_t, 4>;

/// Threefry4x32 with its 20 rounds: random words that are a function of a key and a counter alone. So draw n of a
/// stream is the same whatever was drawn before it, and many are drawn at once: adding, shifting and xor vectorise
/// everywhere. Salmon, Moraes, Dror and Shaw, "Parallel random numbers: as easy as 1, 2, 3", SC 2011.
URBAN_GNSS_INLINE RandomWords threefry(const RandomWords& key, const RandomWords& counter) {
  const std::uint32_t keys[5] = {key[0], key[1], key[2], key[3], 0x1BD11BDAU ^ key[0] ^ key[1] ^ key[2] ^ key[3]};
  std::uint32_t a = counter[0] + keys[0], b = counter[1] + keys[1], c = counter[2] + keys[2], d = counter[3] + keys[3];
  const auto mix = [](std::uint32_t& x, std::uint32_t& y, int bits) URBAN_GNSS_INLINE_LAMBDA {
    x += y;
    y = ((y << bits) | (y >> (32 - bits))) ^ x;
  };
  const auto two_rounds = [&](int ab, int cd, int ad, int cb) URBAN_GNSS_INLINE_LAMBDA {
    mix(a, b, ab);
    mix(c, d, cd);
    mix(a, d, ad);
    mix(c, b, cb);
  };
  const auto inject = [&](std::uint32_t n) URBAN_GNSS_INLINE_LAMBDA {
    a += keys[n % 5];
    b += keys[(n + 1) % 5];
    c += keys[(n + 2) % 5];
    d += keys[(n + 3) % 5] + n;
  };
  const auto four_rounds = [&](bool odd) URBAN_GNSS_INLINE_LAMBDA {
    if (odd) {
      two_rounds(10, 26, 11, 21);
      two_rounds(13, 27, 23, 5);
    } else {
      two_rounds(6, 20, 17, 11);
      two_rounds(25, 10, 18, 20);
    }
  };
  four_rounds(true);
  inject(1);
  four_rounds(false);
  inject(2);
  four_rounds(true);
  inject(3);
  four_rounds(false);
  inject(4);
  four_rounds(true);
  inject(5);
  return {a, b, c, d};
}

/// A stream of draws: the n-th is a function of the stream's key and n.
class RandomStream {
 public:
  explicit RandomStream(std::uint64_t key)
      : key_{static_cast<std::uint32_t>(key), static_cast<std::uint32_t>(key >> 32U), 0, 0} {}

  URBAN_GNSS_INLINE RandomWords words(std::size_t n) const {
    return threefry(key_, {static_cast<std::uint32_t>(n), 0, 0, 0});
  }

 private:
  RandomWords key_;
};

/// A random word as a number in (0, 1).
URBAN_GNSS_INLINE float to_uniform(std::uint32_t word) {
  return (static_cast<float>(static_cast<std::int32_t>(word >> 1U)) + 0.5F) * 0x1p-31F;
}

/// A random word as an angle in [-pi, pi], rad.
URBAN_GNSS_INLINE float to_angle(std::uint32_t word) {
  return static_cast<float>(static_cast<std::int32_t>(word)) * (kPiF * 0x1p-31F);
}

/// Two independent standard normal draws of two random words: Box and Muller, "A note on the generation of random
/// normal deviates", 1958. None is beyond 6.7.
struct NormalPair {
  float first, second;
};
URBAN_GNSS_INLINE NormalPair to_normals(std::uint32_t a, std::uint32_t b) {
  const float radius = std::sqrt(-2.0F * vector_log(to_uniform(a)));
  const SineCosine direction = vector_sincos(to_angle(b));
  return {radius * direction.cosine, radius * direction.sine};
}

}  // namespace urban_gnss
