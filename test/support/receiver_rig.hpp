#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "urban_gnss_localization/simulation/receiver.hpp"

namespace urban_gnss {

inline constexpr double kEpoch = 0.2;  // s

inline double quantile(std::vector<double> values, double share) {
  if (values.empty()) return std::nan("");
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(share * static_cast<double>(values.size() - 1))];
}

inline ReceivedSatellite satellite(int svid, double azimuth_deg, double elevation_deg,
                                   Constellation constellation = Constellation::kGps) {
  ReceivedSatellite result;
  result.id = {constellation, svid};
  result.look = {degrees_to_radians(azimuth_deg), degrees_to_radians(elevation_deg)};
  result.line_of_sight = line_of_sight(result.look);
  return result;
}

inline std::vector<ReceivedSatellite> open_sky() {
  std::vector<ReceivedSatellite> sky;
  for (int i = 0; i < 8; ++i) sky.push_back(satellite(i + 1, 45.3 * i, 20.2 + 8.1 * i));
  for (int i = 0; i < 6; ++i)
    sky.push_back(satellite(i + 1, 61.0 * i + 20.0, 15.0 + 10.0 * i, Constellation::kGalileo));
  return sky;
}

inline ReceiverParameters without_noise() {
  ReceiverParameters parameters;
  parameters.channel.cn0_offset_sigma = 0.0;
  parameters.channel.cn0_noise_sigma = 0.0;
  parameters.channel.atmosphere_sigma = 0.0;
  parameters.channel.code_bandwidth = 1e-6;
  parameters.channel.acquisition_time = 0.0;
  parameters.velocity_sigma = 0.0;
  parameters.velocity_nlos_sigma = 0.0;
  parameters.smoothing_time = 0.0;
  return parameters;
}

inline Reflection reflection(double excess_m, double loss_db, int count = 1) {
  Reflection result;
  result.excess_m = excess_m;
  result.loss_db = loss_db;
  result.count = count;
  return result;
}

inline ReceivedSatellite behind_a_wall(double excess_m, double loss_db) {
  ReceivedSatellite result = satellite(1, 0.0, 40.0);
  result.paths.is_blocked = true;
  result.paths.has_direct = false;
  result.paths.reflections = {reflection(excess_m, loss_db)};
  return result;
}

}  // namespace urban_gnss
