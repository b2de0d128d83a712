#include "urban_gnss_localization/simulation/pseudoranges.hpp"

#include <cmath>

#include "urban_gnss_localization/geometry/angles.hpp"
#include "urban_gnss_localization/simulation/gauss_markov.hpp"
#include "urban_gnss_localization/simulation/knife_edge.hpp"

namespace urban_gnss {
namespace {

/// One of a satellite's paths as the channel sees it.
struct Arrival {
  double excess_m;
  double loss_db;
  int reflections;  ///< 0 for the line of sight and the way over an edge
};

std::optional<Arrival> strongest(const SignalPaths& paths) {
  std::optional<Arrival> best;
  if (paths.has_direct) best = Arrival{paths.excess_m, paths.loss_db, 0};
  for (const Reflection& reflection : paths.reflections) {
    if (best && best->loss_db <= reflection.loss_db) continue;
    best = Arrival{reflection.excess_m, reflection.loss_db, reflection.count};
  }
  return best;
}

Interference interference(const Arrival& other, const Arrival& tracked) {
  const double delay_m = other.excess_m - tracked.excess_m;
  const double half_turns = other.reflections - tracked.reflections;
  return {delay_m, std::pow(10.0, 0.05 * (tracked.loss_db - other.loss_db)),
          kPi * (half_turns + 2.0 * delay_m / kL1Wavelength_m)};
}

}  // namespace

EnumNames<PathClass> enum_names(PathClass) {
  return {{"direct", PathClass::kDirect},
          {"multipath", PathClass::kMultipath},
          {"nlos", PathClass::kNlos},
          {"blocked", PathClass::kBlocked}};
}

void ChannelParameters::check(std::vector<std::string>& faults) const {
  if (!(cn0_horizon <= cn0_zenith)) faults.push_back("cn0_horizon: must be at most cn0_zenith");
  if (!(tracking_threshold <= acquisition_threshold)) {
    faults.push_back("tracking_threshold: must be at most acquisition_threshold");
  }
}

double free_cn0_dbhz(double elevation_rad, const ChannelParameters& parameters) {
  const double sine = std::sin(elevation_rad);
  return parameters.cn0_horizon + (parameters.cn0_zenith - parameters.cn0_horizon) * sine;
}

double atmosphere_mapping(double elevation_rad) {
  const double sine = std::sin(elevation_rad);
  return 1.001 / std::sqrt(0.002001 + sine * sine);
}

SatelliteChannel::SatelliteChannel(const ChannelParameters& parameters, RandomEngine& engine)
    : cn0_offset_db_(parameters.cn0_offset_sigma * draw_normal(engine)),
      cn0_noise_(draw_normal(engine)),
      atmosphere_(draw_normal(engine)),
      code_noise_(draw_normal(engine)) {}

ChannelOutput SatelliteChannel::step(double interval_s, const ReceivedSatellite& satellite,
                                     const ChannelParameters& parameters, RandomEngine& engine) {
  const double loop_time_s = 0.25 / parameters.code_bandwidth;
  step_gauss_markov(cn0_noise_, interval_s, parameters.cn0_noise_time, engine);
  step_gauss_markov(atmosphere_, interval_s, parameters.atmosphere_time, engine);
  step_gauss_markov(code_noise_, interval_s, loop_time_s, engine);

  const SignalPaths& paths = satellite.paths;
  const auto tracked = strongest(paths);
  const double elevation_rad = satellite.look.elevation_rad;
  const double free_dbhz =
      free_cn0_dbhz(elevation_rad, parameters) + cn0_offset_db_ + parameters.cn0_noise_sigma * cn0_noise_;
  const double cn0_dbhz = tracked ? free_dbhz - tracked->loss_db : 0.0;
  const double threshold = is_tracked_ ? parameters.tracking_threshold : parameters.acquisition_threshold;
  const bool was_tracked = is_tracked_;
  if (tracked && cn0_dbhz >= threshold) {
    is_tracked_ = is_tracked_ || heard_for_s_ >= parameters.acquisition_time;
    heard_for_s_ += interval_s;
  } else {
    is_tracked_ = false;
    heard_for_s_ = 0.0;
  }
  if (!is_tracked_) return {};

  const double reach_m = (1.0 + 0.5 * parameters.correlator_spacing) * kChip_m;
  interferences_.clear();
  const auto add = [&](const Arrival& other) {
    const Interference candidate = interference(other, *tracked);
    if (std::abs(candidate.delay_m) < reach_m) interferences_.push_back(candidate);
  };
  const Arrival direct{paths.excess_m, paths.loss_db, 0};
  if (paths.has_direct && tracked->reflections > 0) add(direct);
  for (const Reflection& reflection : paths.reflections) {
    // The tracked one itself, or one that cannot be told from it.
    const bool is_tracked_path = reflection.excess_m == tracked->excess_m && reflection.count == tracked->reflections;
    if (!is_tracked_path) add({reflection.excess_m, reflection.loss_db, reflection.count});
  }
  const double settled_m = multipath_error_m(interferences_, parameters.correlator_spacing);
  const double gain = was_tracked ? 1.0 - std::exp(-interval_s / loop_time_s) : 1.0;
  multipath_m_ += gain * (settled_m - multipath_m_);

  ChannelOutput output;
  output.is_tracked = true;
  output.cn0_dbhz = cn0_dbhz;
  output.excess_m = tracked->excess_m;
  if (tracked->reflections > 0 || paths.is_blocked) {
    output.path_class = PathClass::kNlos;
  } else {
    output.path_class = interferences_.empty() ? PathClass::kDirect : PathClass::kMultipath;
  }
  const double noise_sigma_m = code_noise_sigma_m(cn0_dbhz, parameters.code_bandwidth, parameters.correlator_spacing,
                                                  parameters.integration_time);
  output.range_error_m = tracked->excess_m + multipath_m_ + noise_sigma_m * code_noise_ +
                         parameters.atmosphere_sigma * atmosphere_mapping(elevation_rad) * atmosphere_;
  return output;
}

}  // namespace urban_gnss
