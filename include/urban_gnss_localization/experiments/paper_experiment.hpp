#pragma once

#include <yaml-cpp/yaml.h>

#include <functional>
#include <string>
#include <vector>

#include "urban_gnss_localization/control/waypoint_controller.hpp"
#include "urban_gnss_localization/localizers/nishida/bias_kalman_filter.hpp"
#include "urban_gnss_localization/localizers/nishida/particle_filter.hpp"
#include "urban_gnss_localization/localizers/switching/switching_particle_filter.hpp"
#include "urban_gnss_localization/simulation/paper_field.hpp"

namespace urban_gnss {

/// Everything that the simulation of section 4 depends on.
struct PaperExperimentConditions {
  PaperFieldParameters field;
  MotionParameters field_motion;   ///< of the robot
  MotionParameters filter_motion;  ///< that the particle filter assumes
  GpsBiasParameters bias;
  ParticleFilterParameters filter;
  SwitchingParticleFilterParameters switching;
  MotionParameters switching_motion;  ///< that they assume
  WaypointControllerParameters controller;
  int laps{3};
  bool closed_loop{true};  ///< steer on the estimate; otherwise on the truth
};

/// The YAML files of config/paper_field that the experiment shares with the nodes.
inline constexpr const char* kPaperFileNames[] = {"simulator", "particle_filter", "switching_particle_filter",
                                                  "gps_bias", "waypoint_controller"};

/// The conditions that the files describe, a map of their names to their contents; the targets are the field's. Throws
/// ParameterError with every fault of all files.
PaperExperimentConditions read_paper_conditions(const YAML::Node& files);

/// A way to estimate the pose, by the name that tables and files use.
struct PaperMethod {
  enum class Kind {
    kFilter,         ///< the particle filter of Nishida et al.
    kSwitching,      ///< the switching particle filter
    kImm,            ///< interacting multiple models, with the switching particle filter's model
    kDeadReckoning,  ///< the inputs alone, from a start as uncertain as one particle's
    kOracleZone,     ///< knows the zone: drops the fix in the shadow
    kOracle,         ///< knows zone and bias: takes the bias off and uses the right noise
  };
  std::string name;
  Kind kind{Kind::kFilter};
  std::string description;
  std::function<void(PaperExperimentConditions&)> configure;  ///< what differs from the conditions
};

/// Every method that the experiment knows.
const std::vector<PaperMethod>& paper_methods();

/// One step of one run: truth, measurement and estimate.
struct PaperStep {
  double time_s{0.0};
  int lap{0};
  Pose2 truth;
  Pose2 estimate;
  SimulatedFix fix;
  double radius_m{0.0};
  double effective_sample_size{0.0};
  double cross_track_m{0.0};  ///< distance of the truth from the polygon of the targets
};

/// Called after each step; `particles` is empty for methods without.
using PaperObserver = std::function<void(const PaperStep&, const ParticleSet* particles)>;

/// Drives the robot for `conditions.laps` rounds, or for half as long again as that takes along the ring at constant
/// speed, with one method. Everything random follows from field.seed and filter.seed.
void run_paper_experiment(const PaperMethod& method, PaperExperimentConditions conditions,
                          const PaperObserver& observer);

}  // namespace urban_gnss
