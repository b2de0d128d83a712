#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "urban_gnss_localization/common/parameters.hpp"
#include "urban_gnss_localization/common/stamp.hpp"
#include "urban_gnss_localization/geometry/geodetic_position.hpp"
#include "urban_gnss_localization/geometry/pose2.hpp"

namespace urban_gnss {

/// How far a saved state is believed.
struct SavedStateParameters {
  double state_max_age{60.0};
  double state_speed{2.0};
  double state_yaw_rate{0.2};

  void visit(ParameterVisitor& v) {
    v("state_max_age", state_max_age, positive(), "s",
      "age, by the odometry's stamps, up to which a state of ~state_file is restored");
    v("state_speed", state_speed, non_negative(), "m/s",
      "speed by which the standard deviation of a restored position grows with the state's age");
    v("state_yaw_rate", state_yaw_rate, non_negative(), "rad/s", "the same of a restored heading");
  }
};

/// Where a robot was, for a localizer that is started again.
struct SavedState {
  Stamp stamp{0};  ///< of the odometry up to which the estimate goes
  std::string map_frame;
  std::string base_link_frame;
  GeodeticPosition datum;
  PoseEstimate estimate;  ///< base in the map frame
};

/// Why no robot can have such a state, with the field and the numbers; empty where one can.
std::string state_fault(const SavedState& state);
/// Why the state says nothing of the robot at `now`: it is older than state_max_age, or later than `now`. Empty where
/// it does.
std::string age_fault(const SavedState& state, Stamp now, const SavedStateParameters& parameters);
/// The estimate at `now`, up to which the robot may have moved by state_speed and turned by state_yaw_rate. Requires
/// no age_fault().
PoseEstimate estimate_at(const SavedState& state, Stamp now, const SavedStateParameters& parameters);

/// As JSON, in which every number keeps its value.
std::string to_text(const SavedState& state);
/// Throws std::invalid_argument that names what is wrong: no JSON, another format, a field, or state_fault().
SavedState to_saved_state(const std::string& text);

/// Writes the file whole or not at all (PendingFile). Throws std::runtime_error that names it.
void write_state(const std::filesystem::path& file, const SavedState& state);
/// Nothing where there is no such file. Throws std::invalid_argument as to_saved_state() does, or where the file cannot
/// be read, or is too large for a state.
std::optional<SavedState> read_state(const std::filesystem::path& file);
/// Why a state cannot be kept in a file of this name: the path is not absolute, has control characters, is no ordinary
/// file, or its folder is not there. Empty where it can.
std::string state_file_fault(const std::string& path);

}  // namespace urban_gnss
