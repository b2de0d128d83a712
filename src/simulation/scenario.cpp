#include "urban_gnss_localization/simulation/scenario.hpp"

#include <boost/date_time/posix_time/posix_time.hpp>
#include <cmath>
#include <filesystem>
#include <regex>
#include <stdexcept>
#include <utility>

#include "scenario_nodes.hpp"
#include "urban_gnss_localization/geometry/local_frame.hpp"
#include "urban_gnss_localization/parameters/assignment.hpp"
#include "urban_gnss_localization/parameters/parameter_reader.hpp"
#include "urban_gnss_localization/parameters/yaml_files.hpp"
#include "urban_gnss_localization/simulation/scenario_world.hpp"

namespace urban_gnss {
namespace {

/// The scenario's values that stand in no section.
struct Header {
  std::vector<double> datum{48.1374, 11.5755, 520.0};
  std::string start_time{"2026-05-04T09:30:00Z"};
  int seed{1};
  double duration{0.0};
  std::vector<double> start;

  void visit(ParameterVisitor& v) {
    v("datum", datum, "", "");
    v("start_time", start_time, "");
    v("seed", seed, non_negative(), "", "");
    v("duration", duration, non_negative(), "", "");
    v("start", start, "", "empty: on the route's first waypoint, towards the next");
  }
  void check(std::vector<std::string>& faults) const {
    if (datum.size() != 3) {
      faults.push_back("datum: must be latitude (deg), longitude (deg) and altitude (m)");
    } else {
      for (const auto& fault : position_faults({datum[0], datum[1], datum[2]})) faults.push_back("datum: " + fault);
    }
    if (!start.empty() && start.size() != 3) faults.push_back("start: must be x (m), y (m) and yaw (rad)");
    if (start.size() == 3 && !is_in_world({start[0], start[1]})) {
      faults.push_back("start: is more than 100 km from the origin");
    }
    try {
      parse_utc(start_time);
    } catch (const std::invalid_argument& error) {
      faults.push_back("start_time: " + std::string(error.what()));
    }
  }
};

struct CarFields {
  double speed{CarParameters().speed_mps};
  double phase{0.0};
  int count{1};
  double length{CarParameters().length_m};
  double width{CarParameters().width_m};
  double height{CarParameters().height_m};

  void visit(ParameterVisitor& v) {
    v("speed", speed, any_number(), "", "");
    v("phase", phase, any_number(), "", "");
    v("count", count, between(1.0, 1000.0), "", "cars evenly along the loop");
    v("length", length, positive(), "", "");
    v("width", width, positive(), "", "");
    v("height", height, positive(), "", "");
  }
};

class ScenarioReader {
 public:
  ScenarioReader(const YAML::Node& root, std::string file) : root_(root), file_(std::move(file)), top_(root, file_) {}

  Scenario read() {
    scenario_.file = file_;
    Header header;
    top_.read(header);
    scenario_.seed = header.seed;
    scenario_.duration_s = header.duration;
    if (header.datum.size() == 3) scenario_.datum = {header.datum[0], header.datum[1], header.datum[2]};

    for (const char* name : {"buildings", "trees"}) top_.ignore(name);
    std::vector<std::string> world_problems;
    scenario_.world = read_world(root_, file_, world_problems);
    top_.add(world_problems);
    read_route();
    read_cars();
    section("vehicle", scenario_.vehicle);
    section("autopilot", scenario_.autopilot);
    section("odometry", scenario_.odometry);
    section("imu", scenario_.imu);
    section("compass", scenario_.compass);
    section("sky", scenario_.sky);
    section("signals", scenario_.signals);
    section("receiver", scenario_.receiver);
    section("lidar", scenario_.lidar);
    read_faults();
    set_start(header);

    const auto faults = top_.finish();
    if (!faults.empty()) throw ParameterError(file_, faults);
    scenario_.start_time = parse_utc(header.start_time);
    return std::move(scenario_);
  }

 private:
  template <class P>
  void section(const std::string& name, P& parameters) {
    ParameterReader reader(top_.child(name), file_, name + ".");
    reader.read(parameters);
    top_.add(reader.finish());
  }

  /// Calls read(reader of the entry, name of the entry) for each entry of a list that may be absent.
  template <class Read>
  void for_each_entry(const std::string& name, Read&& read) {
    const YAML::Node list = top_.child(name);
    if (list.IsNull()) return;
    if (!list.IsSequence()) {
      top_.fault(name, "must be a list");
      return;
    }
    for (std::size_t i = 0; i < list.size(); ++i) {
      const std::string entry_name = name + "[" + std::to_string(i) + "]";
      ParameterReader reader(list[i], file_, entry_name + ".");
      read(reader, entry_name);
      top_.add(reader.finish());
    }
  }

  void read_route() {
    ParameterReader reader(top_.child("route"), file_, "route.");
    double speed = RouteWaypoint().speed_mps;
    std::string track;
    reader("loop", scenario_.route.loop, "the route begins anew at its end");
    reader("speed", speed, positive(), "m/s", "until a waypoint gives another");
    reader("track", track, "file of a recorded drive");
    const YAML::Node waypoints = reader.child("waypoints");
    if (track.empty() == waypoints.IsNull()) {
      reader.fault("waypoints", "a route needs either waypoints or a track");
    } else if (!track.empty()) {
      read_recorded_track(track, reader);
    } else {
      read_waypoints(waypoints, speed, reader);
      try {
        require_drivable(scenario_.route);
      } catch (const std::invalid_argument& error) {
        reader.fault("waypoints", error.what());
      }
    }
    top_.add(reader.finish());
  }

  void read_recorded_track(const std::string& track, ParameterReader& reader) {
    const bool loop = scenario_.route.loop;
    try {
      scenario_.route = read_track((std::filesystem::path(file_).parent_path() / track).string());
      scenario_.route.loop = loop;
    } catch (const std::exception& error) {
      reader.fault("track", error.what());
    }
  }

  /// Each [x, y] or {at: [x, y], speed: 5, stop: 10}. A speed holds until the next.
  void read_waypoints(const YAML::Node& waypoints, double speed_mps, ParameterReader& reader) {
    for (std::size_t i = 0; i < waypoints.size(); ++i) {
      const std::string name = "waypoints[" + std::to_string(i) + "]";
      const YAML::Node node = waypoints[i];
      RouteWaypoint waypoint;
      auto place = point_of(node);
      if (node.IsMap()) {
        ParameterReader entry(node, file_, "route." + name + ".");
        place = point_of(entry.child("at"));
        entry("speed", speed_mps, positive(), "m/s", "from here on");
        entry("stop", waypoint.stop_s, non_negative(), "s", "to stand here");
        reader.add(entry.finish());
      }
      if (!place) {
        reader.fault(node, name, "must be [x, y], or {at: [x, y], speed: m/s, stop: s}");
        continue;
      }
      waypoint.position = *place;
      waypoint.speed_mps = speed_mps;
      scenario_.route.waypoints.push_back(waypoint);
    }
  }

  void read_cars() {
    for_each_entry("cars", [this](ParameterReader& reader, const std::string&) {
      CarFields fields;
      reader.read(fields);
      CarParameters car;
      const YAML::Node loop = reader.child("loop");
      for (std::size_t i = 0; loop.IsSequence() && i < loop.size(); ++i) {
        const auto corner = point_of(loop[i]);
        if (corner) {
          car.loop.push_back(*corner);
        } else {
          reader.fault(loop[i], "loop[" + std::to_string(i) + "]", "must be two finite numbers, [x, y]");
        }
      }
      car.speed_mps = fields.speed;
      car.length_m = fields.length;
      car.width_m = fields.width;
      car.height_m = fields.height;
      try {
        const Car checked(car);
        double length_m = 0.0;
        for (std::size_t i = 0; i < car.loop.size(); ++i) {
          length_m += (car.loop[(i + 1) % car.loop.size()] - car.loop[i]).norm();
        }
        for (int k = 0; k < fields.count; ++k) {
          car.phase_m = fields.phase + length_m * k / fields.count;
          scenario_.cars.push_back(car);
        }
      } catch (const std::invalid_argument& error) {
        reader.fault("loop", error.what());
      }
    });
  }

  void read_faults() {
    for_each_entry("faults", [this](ParameterReader& reader, const std::string&) {
      FixFault fault;
      reader.read(fault);
      scenario_.faults.push_back(fault);
    });
  }

  void set_start(const Header& header) {
    if (header.start.size() == 3) {
      scenario_.start = {header.start[0], header.start[1], wrap_angle(header.start[2])};
    } else if (scenario_.route.waypoints.size() > 1) {
      scenario_.start = scenario_.route.start();
    } else {
      return;  // a fault of the route
    }
    for (const std::string& fault : world_faults(scenario_.world, scenario_.start.position())) {
      top_.fault(header.start.empty() ? "route" : "start", fault);
    }
    if (scenario_.route.loop && !(scenario_.duration_s > 0.0)) {
      top_.fault("duration", "a route that is a loop has no end: a duration is needed");
    }
  }

  YAML::Node root_;
  std::string file_;
  ParameterReader top_;
  Scenario scenario_;
};

}  // namespace

Stamp parse_utc(const std::string& text) {
  static const std::regex format(R"((\d{4})-(\d{2})-(\d{2})T(\d{2}):(\d{2}):(\d{2})Z)");
  const std::string fault = text + ": must be a time in UTC like 2026-05-04T09:30:00Z, of 1980 to 2100";
  std::smatch match;
  if (!std::regex_match(text, match, format)) throw std::invalid_argument(fault);
  try {
    const boost::gregorian::date date(static_cast<unsigned short>(std::stoi(match[1])),
                                      static_cast<unsigned short>(std::stoi(match[2])),
                                      static_cast<unsigned short>(std::stoi(match[3])));
    const int hour = std::stoi(match[4]);
    const int minute = std::stoi(match[5]);
    const int second = std::stoi(match[6]);
    if (hour > 23 || minute > 59 || second > 59 || date.year() < 1980 || date.year() > 2100) {
      throw std::invalid_argument(fault);  // the stamps of ROS end in 2106
    }
    const std::int64_t days = (date - boost::gregorian::date(1970, 1, 1)).days();
    return std::chrono::hours(24 * days + hour) + std::chrono::minutes(minute) + std::chrono::seconds(second);
  } catch (const std::out_of_range&) {  // no such day
    throw std::invalid_argument(fault);
  }
}

Scenario load_scenario(const std::string& file, const std::vector<std::string>& overrides) {
  if (!std::filesystem::exists(file)) {
    std::string beside;
    for (const std::string& name : yaml_files(std::filesystem::path(file).parent_path())) {
      beside += (beside.empty() ? "; there are " : ", ") + name;
    }
    throw std::runtime_error(file + ": no such file" + beside);
  }
  const YAML::Node root = load_map(file);
  if (root.size() == 0) throw std::runtime_error(file + ": must be a map of names to values");
  for (const std::string& text : overrides) assign(root, text);
  return ScenarioReader(root, file).read();
}

}  // namespace urban_gnss
