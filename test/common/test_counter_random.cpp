#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "matchers.hpp"
#include "urban_gnss_localization/common/counter_random.hpp"

namespace urban_gnss {
namespace {

// The known answers of Random123, the authors' library (kat_vectors, threefry4x32 with 20 rounds).
TEST(CounterRandom, IsThreefryOfSalmonEtAl) {
  const std::uint32_t ones = 0xFFFFFFFFU;
  EXPECT_EQ(threefry({0, 0, 0, 0}, {0, 0, 0, 0}), (RandomWords{0x9c6ca96a, 0xe17eae66, 0xfc10ecd4, 0x5256a7d8}));
  EXPECT_EQ(threefry({ones, ones, ones, ones}, {ones, ones, ones, ones}),
            (RandomWords{0x2a881696, 0x57012287, 0xf6c7446e, 0xa16a6732}));
  EXPECT_EQ(
      threefry({0xa4093822, 0x299f31d0, 0x082efa98, 0xec4e6c89}, {0x243f6a88, 0x85a308d3, 0x13198a2e, 0x03707344}),
      (RandomWords{0x59cd1dbb, 0xb8879579, 0x86b5d00c, 0xac8b6d84}));
}

TEST(CounterRandom, StreamsOfDifferentKeysDiffer) {
  EXPECT_NE(RandomStream(1).words(7), RandomStream(2).words(7));
  EXPECT_NE(RandomStream(1).words(7), RandomStream(1ULL << 32U).words(7));
  EXPECT_NE(RandomStream(1).words(7), RandomStream(1).words(8));
  EXPECT_EQ(RandomStream(1).words(7), RandomStream(1).words(7));
}

TEST(CounterRandom, EveryWordGivesAFiniteNumber) {
  for (const std::uint32_t word : {0U, 1U, 0x7FFFFFFFU, 0x80000000U, 0xFFFFFFFFU}) {
    EXPECT_GT(to_uniform(word), 0.0F);
    EXPECT_LE(to_uniform(word), 1.0F);
    EXPECT_LE(std::abs(to_angle(word)), kPiF);
    for (const std::uint32_t other : {0U, 0x40000000U, 0xC0000000U}) {
      const NormalPair pair = to_normals(word, other);
      EXPECT_LT(std::hypot(pair.first, pair.second), 6.7F);
    }
  }
}

TEST(CounterRandom, NormalsAreIndependentAndNormal) {
  constexpr std::size_t kCount = 100000;
  const RandomStream stream(3);
  std::vector<double> draws[4];
  for (std::size_t i = 0; i < kCount; ++i) {
    const RandomWords words = stream.words(i);
    const NormalPair one = to_normals(words[0], words[1]);
    const NormalPair two = to_normals(words[2], words[3]);
    const double values[4] = {one.first, one.second, two.first, two.second};
    for (int k = 0; k < 4; ++k) draws[k].push_back(values[k]);
  }
  for (const auto& values : draws) EXPECT_TRUE(has_moments(values, 0.0, 1.0));
  // Neighbouring draws, and those of neighbouring counters.
  for (int k = 0; k < 4; ++k) {
    std::vector<double> sums, lagged;
    for (std::size_t i = 0; i + 1 < kCount; i += 2) {
      sums.push_back((draws[k][i] + draws[(k + 1) % 4][i]) / std::sqrt(2.0));
      lagged.push_back((draws[k][i] + draws[k][i + 1]) / std::sqrt(2.0));
    }
    EXPECT_TRUE(has_moments(sums, 0.0, 1.0)) << k;  // 1 plus the correlation
    EXPECT_TRUE(has_moments(lagged, 0.0, 1.0)) << k;
  }
  // Shares beyond one to three sigma are those of the normal distribution, within 4.5 of their standard deviations.
  for (const double limit : {1.0, 2.0, 3.0}) {
    double count = 0.0;
    for (const double draw : draws[2]) count += std::abs(draw) > limit;
    const double share = std::erfc(limit / std::sqrt(2.0));
    EXPECT_NEAR(count / kCount, share, 4.5 * std::sqrt(share * (1.0 - share) / kCount)) << limit;
  }
}

}  // namespace
}  // namespace urban_gnss
