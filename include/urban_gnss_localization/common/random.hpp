#pragma once

#include <boost/random/mersenne_twister.hpp>
#include <boost/random/normal_distribution.hpp>
#include <boost/random/uniform_01.hpp>
#include <cstdint>

namespace urban_gnss {

/// The engine that is passed to everything random. Boost's engine and distributions give the same numbers on every
/// platform and compiler, which the standard's distributions do not.
using RandomEngine = boost::random::mt19937_64;

/// Engines for independent streams of one experiment: stream `stream` of seed `seed`. SplitMix64 finaliser over both,
/// so that neighbouring seeds and streams start far apart.
inline RandomEngine make_engine(std::uint64_t seed, std::uint64_t stream = 0) {
  std::uint64_t z = seed * 0x9E3779B97F4A7C15ULL + stream * 0xD1B54A32D192ED03ULL + 0x9E3779B97F4A7C15ULL;
  z = (z ^ (z >> 30U)) * 0xBF58476D1CE4E5B9ULL;
  z = (z ^ (z >> 27U)) * 0x94D049BB133111EBULL;
  return RandomEngine(z ^ (z >> 31U));
}

/// One draw from N(0, 1) (ziggurat).
inline double draw_normal(RandomEngine& engine) {
  boost::random::normal_distribution<double> distribution;
  return distribution(engine);
}

/// One draw from [0, 1).
inline double draw_uniform(RandomEngine& engine) { return boost::random::uniform_01<double>()(engine); }

}  // namespace urban_gnss
