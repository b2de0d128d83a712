#pragma once

#include <stdexcept>
#include <string>
#include <vector>

#include "urban_gnss_localization/parameters/parameter_reader.hpp"
#include "urban_gnss_localization/localizers/kim/complementary_ekf.hpp"
#include "urban_gnss_localization/localizers/switching/imm_ekf.hpp"
#include "urban_gnss_localization/localizers/switching/switching_particle_filter.hpp"
#include "urban_gnss_localization/localizers/maier/ukf.hpp"
#include "urban_gnss_localization/ros/localizer_node.hpp"
#include "urban_gnss_localization/ros/topics.hpp"

namespace urban_gnss {

/// What the command line says.
struct ReplayOptions {
  std::string input;
  std::string localizer = "imm_ekf";
  std::vector<std::string> params;
  std::vector<std::string> overrides;
  std::string output;
  std::string fix_topic = topics::kFix;
  std::string odom_topic = topics::kOdometry;
  std::string imu_topic = topics::kImu;
  bool wants_imu = false;  ///< imu_topic was asked for
  std::string velocity_topic = topics::kVelocity;
  bool wants_velocity = false;  ///< velocity_topic was asked for
  std::string satellites_topic = topics::kSatellites;
  bool wants_satellites = false;  ///< satellites_topic was asked for
  std::string truth_topic = topics::kTruth;
  std::vector<double> datum;
  int seed = -1;
  std::string json_file;
  std::string tum_file;
};

/// All that is configurable: what the live localizer and the live bias node read.
struct ReplayParameters {
  LocalizerNodeParameters node;
  ParticleFilterParameters filter;
  ImmEkfParameters imm;
  UkfParameters ukf;
  MotionParameters motion;
  GpsBiasParameters bias;
  ComplementaryEkfParameters complementary;
};

/// Files in their order, later values over earlier ones. A file may hold the parameters flat, or by node as rosparam
/// does (`particle_filter:` with `gps_bias:`, `complementary_ekf:`).
inline YAML::Node merge_parameters(const ReplayOptions& options) {
  YAML::Node merged(YAML::NodeType::Map);
  const auto merge = [&merged](const YAML::Node& map) {
    for (const auto& entry : map) merged[entry.first.as<std::string>()] = entry.second;
  };
  for (const std::string& file : options.params) {
    YAML::Node map;
    try {
      map = YAML::LoadFile(file);
    } catch (const YAML::Exception& error) {
      throw std::runtime_error("--params " + file + ": " + error.what());
    }
    if (!map.IsMap() && !map.IsNull())
      throw std::runtime_error("--params " + file + ": must be a map of names to values");
    for (const std::string section : {"gps_bias", "particle_filter", "complementary_ekf", "imm_ekf", "ukf"}) {
      if (!map.IsMap() || !map[section].IsDefined()) continue;
      // Sections of other localizers may use the same names for other things.
      if (section == options.localizer || (section == "gps_bias" && options.localizer == "particle_filter")) {
        merge(map[section]);
      }
      map.remove(section);
    }
    if (map.IsMap()) merge(map);
  }
  if (options.wants_imu) merged["use_imu_yaw_rate"] = true;
  for (const std::string& text : options.overrides) {
    const auto equal = text.find('=');
    if (equal == std::string::npos) throw std::runtime_error("--set " + text + ": must be NAME=VALUE");
    merged[text.substr(0, equal)] = YAML::Load(text.substr(equal + 1));
  }
  if (options.seed >= 0) merged["seed"] = options.seed;
  if (!options.datum.empty()) merged["datum"] = options.datum;
  return merged;
}

/// Throws std::runtime_error, ParameterError where a name or a value is not known.
inline ReplayParameters read_parameters(const ReplayOptions& options) {
  ReplayParameters parameters;
  ParameterReader reader(merge_parameters(options));
  for (const char* live_only : {"particle_cloud_rate", "estimate_timeout", "diagnostic_period"})
    reader.ignore(live_only);
  reader.read(parameters.node);
  if (options.localizer == "complementary_ekf") {
    reader.read(parameters.complementary);
  } else if (options.localizer == "imm_ekf") {
    reader.read(parameters.imm).read(parameters.motion);
  } else if (options.localizer == "ukf") {
    reader.read(parameters.ukf).read(parameters.motion);
  } else {
    reader.read(parameters.filter).read(parameters.motion).read(parameters.bias);
  }
  if (options.localizer != "particle_filter") reader.ignore("seed");  // nothing in the others is random
  const auto faults = reader.finish();
  if (!faults.empty()) throw ParameterError("replay", faults);
  return parameters;
}

}  // namespace urban_gnss
