#include "urban_gnss_localization/gnss/nlos_model.hpp"

#include <algorithm>
#include <cmath>

#include "urban_gnss_localization/geometry/angles.hpp"

namespace urban_gnss {
namespace {

constexpr double kReferenceSine = 0.6;
constexpr double kReferenceCotangent = 4.0 / 3.0;
constexpr double kMaxLogOdds = 30.0;

double elevation_factor(double elevation_rad, const NlosParameters& p) {
  // Lower down, the length of the walls bounds the way.
  constexpr double kLowest_rad = 15.0 * kPi / 180.0;
  constexpr double kLowestSine = 0.1;
  double ratio = 1.0;
  switch (p.elevation_law) {
    case NlosElevationLaw::kCotangent:
      ratio = std::max(0.0, 1.0 / std::tan(std::max(elevation_rad, kLowest_rad))) / kReferenceCotangent;
      break;
    case NlosElevationLaw::kCosecant: ratio = kReferenceSine / std::max(std::sin(elevation_rad), kLowestSine); break;
  }
  return std::pow(ratio, p.elevation_exponent);
}

}  // namespace

EnumNames<NlosElevationLaw> enum_names(NlosElevationLaw) {
  return {{"cotangent", NlosElevationLaw::kCotangent}, {"cosecant", NlosElevationLaw::kCosecant}};
}

NlosRange nlos_range(double elevation_rad, const NlosParameters& p, double factor) {
  const double scale = factor * elevation_factor(elevation_rad, p);
  return {scale * p.mean, scale * p.sigma};
}

double cn0_gain_db(double elevation_rad, const NlosParameters& p) {
  return p.cn0_rise * (std::sin(elevation_rad) - kReferenceSine);
}

double levelled_cn0_dbhz(const SatelliteObservation& satellite, const NlosParameters& p) {
  return satellite.cn0_dbhz - cn0_gain_db(satellite.look.elevation_rad, p);
}

double nlos_log_odds(double below_even_db, const NlosParameters& p) { return below_even_db / p.cn0_width; }

double log_odds(double probability) { return std::log(probability / (1.0 - probability)); }

double probability_of(double log_odds) {
  return 1.0 / (1.0 + std::exp(-std::clamp(log_odds, -kMaxLogOdds, kMaxLogOdds)));
}

}  // namespace urban_gnss
