#include "urban_gnss_localization/pipeline/saved_state.hpp"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <system_error>
#include <vector>

#include "text.hpp"
#include "urban_gnss_localization/common/control_characters.hpp"
#include "urban_gnss_localization/common/pending_file.hpp"
#include "urban_gnss_localization/geometry/local_frame.hpp"
#include "urban_gnss_localization/geometry/pose_faults.hpp"

namespace urban_gnss {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

constexpr char kFormat[] = "urban_gnss_localization state 1";
constexpr std::size_t kMostBytes = 1 << 16;

/// Throws std::invalid_argument where there is no such field, or it is of another type.
template <class T>
T field(const json& object, const char* name) {
  const auto found = object.is_object() ? object.find(name) : object.end();
  if (!object.is_object() || found == object.end()) throw std::invalid_argument(std::string(name) + " is missing");
  try {
    return found->get<T>();
  } catch (const json::exception&) {
    throw std::invalid_argument(std::string(name) + " is of another type");
  }
}

}  // namespace

std::string state_fault(const SavedState& state) {
  const std::vector<std::string> faults = position_faults(state.datum);
  if (!faults.empty()) return "datum: " + faults.front();
  return estimate_fault(state.estimate);
}

std::string age_fault(const SavedState& state, Stamp now, const SavedStateParameters& parameters) {
  const double age_s = to_seconds(now - state.stamp);
  if (age_s < 0.0) return "it is " + seconds_text(-age_s) + " later than the odometry";
  if (age_s <= parameters.state_max_age) return {};
  return "it is " + seconds_text(age_s) + " old, at most " + seconds_text(parameters.state_max_age) +
         " are believed (state_max_age)";
}

PoseEstimate estimate_at(const SavedState& state, Stamp now, const SavedStateParameters& parameters) {
  const double age_s = to_seconds(now - state.stamp);
  const double moved_m = parameters.state_speed * age_s;
  const double turned_rad = parameters.state_yaw_rate * age_s;
  PoseEstimate estimate = state.estimate;
  estimate.covariance.diagonal() += Eigen::Vector3d(moved_m, moved_m, turned_rad).cwiseAbs2();
  return estimate;
}

std::string to_text(const SavedState& state) {
  const Eigen::Matrix3d& covariance = state.estimate.covariance;
  const json object{{"format", kFormat},
                    {"stamp_ns", state.stamp.count()},
                    {"map_frame", state.map_frame},
                    {"base_link_frame", state.base_link_frame},
                    {"datum_latitude_deg", state.datum.latitude_deg},
                    {"datum_longitude_deg", state.datum.longitude_deg},
                    {"datum_altitude_m", state.datum.altitude_m},
                    {"x_m", state.estimate.pose.x},
                    {"y_m", state.estimate.pose.y},
                    {"yaw_rad", state.estimate.pose.yaw},
                    {"covariance", std::vector<double>(covariance.data(), covariance.data() + covariance.size())}};
  return object.dump(2, ' ', false, json::error_handler_t::replace) + '\n';
}

SavedState to_saved_state(const std::string& text) {
  json object;
  try {
    object = json::parse(text);
  } catch (const json::exception&) {
    throw std::invalid_argument("is no whole JSON");
  }
  if (field<std::string>(object, "format") != kFormat) throw std::invalid_argument("format is another one");
  SavedState state;
  state.stamp = Stamp(field<Stamp::rep>(object, "stamp_ns"));
  if (state.stamp < Stamp::zero()) throw std::invalid_argument("stamp_ns is negative");
  state.map_frame = field<std::string>(object, "map_frame");
  state.base_link_frame = field<std::string>(object, "base_link_frame");
  state.datum = {field<double>(object, "datum_latitude_deg"), field<double>(object, "datum_longitude_deg"),
                 field<double>(object, "datum_altitude_m")};
  state.estimate.pose = {field<double>(object, "x_m"), field<double>(object, "y_m"), field<double>(object, "yaw_rad")};
  const auto covariance = field<std::vector<double>>(object, "covariance");
  Eigen::Matrix3d& matrix = state.estimate.covariance;
  if (covariance.size() != static_cast<std::size_t>(matrix.size())) {
    throw std::invalid_argument("covariance has " + std::to_string(covariance.size()) + " numbers, must have 9");
  }
  std::copy(covariance.begin(), covariance.end(), matrix.data());
  const std::string fault = state_fault(state);
  if (!fault.empty()) throw std::invalid_argument(fault);
  state.estimate.pose.yaw = wrap_angle(state.estimate.pose.yaw);
  return state;
}

void write_state(const fs::path& file, const SavedState& state) {
  PendingFile pending(file);
  std::ofstream out(pending.path());
  out << to_text(state);
  out.close();
  if (!out) throw pending.failure();
  pending.commit();
}

std::optional<SavedState> read_state(const fs::path& file) {
  std::error_code error;
  if (!fs::exists(file, error) && !error) return std::nullopt;
  std::ifstream in(file, std::ios::binary);
  std::string text(kMostBytes + 1, '\0');
  if (!fs::is_regular_file(file, error) || !in) throw std::invalid_argument("cannot be read");
  in.read(text.data(), static_cast<std::streamsize>(text.size()));
  text.resize(static_cast<std::size_t>(in.gcount()));
  if (text.size() > kMostBytes) throw std::invalid_argument("is larger than a state");
  return to_saved_state(text);
}

std::string state_file_fault(const std::string& path) {
  if (std::any_of(path.begin(), path.end(), is_control)) return "state_file has control characters (a newline, NUL)";
  const fs::path file(path);
  const std::string name = "state_file = " + path;
  if (!file.is_absolute()) return name + ": must be an absolute path";
  std::error_code error;
  if (!file.has_filename() || !fs::is_directory(file.parent_path(), error)) return name + ": there is no such folder";
  if (fs::exists(file, error) && !fs::is_regular_file(file, error)) return name + ": is no ordinary file";
  return {};
}

}  // namespace urban_gnss
