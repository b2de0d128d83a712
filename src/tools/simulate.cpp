// Drives a scenario offline and writes what the robot's sensors publish into a bag, with the ground truth beside it.
// The same scenario and seed give the same bag, byte for byte.

#include <sensor_msgs/NavSatFix.h>

#include <chrono>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <iomanip>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <system_error>

#include "command_line.hpp"
#include "files/output_bag.hpp"
#include "files/output_file.hpp"
#include "find_scenario.hpp"
#include "urban_gnss_localization/common/progress.hpp"
#include "urban_gnss_localization/parameters/assignment.hpp"
#include "urban_gnss_localization/parameters/parameter_reader.hpp"
#include "urban_gnss_localization/simulation/city_simulator.hpp"
#include "urban_gnss_localization/simulation/paper_field_simulator.hpp"
#include "urban_gnss_localization/simulation/simulation_statistics.hpp"
#include "urban_gnss_localization/simulation_ros/simulation_messages.hpp"

namespace fs = std::filesystem;
using namespace urban_gnss;

namespace {

constexpr double kPaperFieldDuration_s = 30.0;  ///< three laps
constexpr double kForecastAfter_s = 5.0;        ///< of a drive that is under way, in which every sensor has spoken

struct Options {
  std::string scenario;
  std::string output;
  std::string json_file;
  std::vector<std::string> overrides;
  int seed = -1;
  double duration_s = 0.0;
  bool without_lidar = false;
};

/// A world with what the bag needs to know of it.
struct Run {
  std::unique_ptr<Simulator> simulator;
  GeodeticPosition datum;
  std::string name;
  int seed = 0;
  std::optional<tf2_msgs::TFMessage> mounting;
};

Run make_paper_field(const fs::path& file, const YAML::Node& values, const Options& options) {
  if (!options.overrides.empty())
    throw std::runtime_error("--set: the paper's field takes none; copy " + file.string());
  PaperFieldParameters field;
  MotionParameters motion;
  WithMotion with_motion{field, motion};
  ParameterReader reader(values, file.string(), "", Layout::kTiered);
  reader.ignore("field");
  reader.read(with_motion);
  if (options.seed >= 0) field.seed = options.seed;
  const auto faults = reader.finish();
  if (!faults.empty()) throw ParameterError(file.string(), faults);
  Run run;
  const double duration_s = options.duration_s > 0.0 ? options.duration_s : kPaperFieldDuration_s;
  run.simulator = std::make_unique<PaperFieldSimulator>(field, motion, duration_s);
  run.datum = PaperFieldSimulator::kDatum;
  run.seed = field.seed;
  return run;
}

Run make_city(const fs::path& file, const SimulationFrames& frames, const Options& options) {
  std::vector<std::string> overrides = options.overrides;
  if (options.seed >= 0) overrides.push_back("seed=" + std::to_string(options.seed));
  if (options.duration_s > 0.0) overrides.push_back("duration=" + std::to_string(options.duration_s));
  if (options.without_lidar) overrides.push_back("lidar.type=none");
  auto city = std::make_unique<CitySimulator>(load_scenario(file.string(), overrides));
  Run run;
  const Scenario& scenario = city->scenario();
  run.datum = scenario.datum;
  run.seed = scenario.seed;
  run.mounting = mounting_transforms(scenario.vehicle.antenna(), scenario.lidar.mount(), to_ros(city->now()), frames);
  run.simulator = std::move(city);
  return run;
}

Run make_run(const Options& options, const SimulationFrames& frames) {
  const fs::path file = find_scenario(options.scenario);
  const YAML::Node values = load_map(file.string());
  const bool is_paper_field = values["field"].IsDefined();
  Run run = is_paper_field ? make_paper_field(file, values, options) : make_city(file, frames, options);
  run.name = file.stem() == "simulator" ? file.parent_path().filename().string() : file.stem().string();
  return run;
}

/// A bag whose messages come in the order of their publication, each a nanosecond after the one before it where both
/// are published at once: who reads a bag gets messages of equal times in an order that rosbag does not define.
class BagWriter {
 public:
  BagWriter(const fs::path& file, const InputFiles& inputs) : bag_(file, inputs) {}
  template <class Message>
  void write(const std::string& topic, Stamp published, const Message& message) {
    last_ = std::max(published, last_ + Stamp(1));
    bag_.write("/" + topic, to_ros(last_), message);
  }
  void close() { bag_.close(); }
  std::uint64_t size() const { return bag_.size(); }

 private:
  OutputBag bag_;
  Stamp last_{0};
};

void print_summary(const ReceiverSummary& summary, std::ostream& out) {
  out << std::fixed << std::setprecision(1);
  out << "fixes           " << summary.epochs << " epochs, " << 100.0 * summary.availability << " % with a fix, "
      << summary.used_mean << " satellites in one\n"
      << "error           median " << summary.error_m.median << " m, 95 % " << summary.error_m.p95 << " m, max "
      << summary.error_m.max << " m, correlation time " << summary.correlation_time_s << " s\n"
      << "claimed sigma   ";
  if (summary.claimed_sigma_m.count > 0) {
    out << "median " << summary.claimed_sigma_m.median << " m, NEES " << summary.nees_mean << " (2 were honest)\n";
  } else {
    out << "none\n";
  }
  out << "path class      share   range error median / 95 % of its size, m   C/N0 median, dB-Hz\n";
  double all = 0.0;
  for (const PathClassSummary& of_class : summary.classes) all += static_cast<double>(of_class.count);
  for (const PathClassSummary& of_class : summary.classes) {
    out << std::left << std::setw(14) << enum_name(of_class.path_class) << std::right << std::setw(5)
        << 100.0 * static_cast<double>(of_class.count) / all << " %";
    if (of_class.range_error_m.count > 0) {
      out << std::setw(16) << of_class.range_error_m.median << " / " << of_class.absolute_range_error_m.p95
          << std::setw(31) << of_class.cn0_dbhz.median;
    }
    out << '\n';
  }
}

/// "1.9 GB" or "240 MB".
std::string bytes_text(double bytes) {
  std::ostringstream text;
  text << std::fixed;
  if (bytes >= 1e9) {
    text << std::setprecision(1) << 1e-9 * bytes << " GB";
  } else {
    text << std::setprecision(0) << std::ceil(1e-6 * bytes) << " MB";
  }
  return text.str();
}

/// How much of the drive (0 to 1) is over, and how large the bag is.
struct Written {
  Stamp stamp{0};
  double done{0.0};
  std::uint64_t size{0};
};

/// How large the bag will be, if what is left of the drive goes on as it did between these two. It begins
/// standing, and slowly.
void print_forecast(const Options& options, const Written& from, const Written& to) {
  const auto size = static_cast<double>(to.size);
  const double bytes = size + (size - static_cast<double>(from.size)) * (1.0 - to.done) / (to.done - from.done);
  std::cerr << options.output << ": will have about " << bytes_text(bytes);
  std::error_code error;
  const fs::path folder = fs::absolute(options.output, error).parent_path();
  const auto space = fs::space(folder, error);
  const double missing = bytes - size - static_cast<double>(space.available);
  if (!error && missing > 0.0) std::cerr << ", for which the disk lacks " << bytes_text(missing);
  if (!options.without_lidar) std::cerr << "; --without-lidar leaves out the scans, most of it";
  std::cerr << '\n';
}

void run(const Options& options, const InputFiles& inputs) {
  const SimulationFrames frames;
  Run run = make_run(options, frames);
  Simulator& simulator = *run.simulator;
  const LocalFrame local(run.datum);
  std::unique_ptr<BagWriter> bag;
  const Stamp begin = simulator.now();
  if (!options.output.empty()) {
    bag = std::make_unique<BagWriter>(options.output, inputs);
    bag->write(topics::kDatum, begin, to_message(run.datum, to_ros(begin), frames.base.map));
    if (run.mounting) bag->write("tf_static", begin, *run.mounting);
  }
  SimulationStatistics statistics;
  std::vector<SimulationEvent> events;
  Progress progress(1000);
  const auto wall_start = std::chrono::steady_clock::now();
  const auto real_time_factor = [&] {
    const double wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - wall_start).count();
    return to_seconds(simulator.now() - begin) / std::max(wall_s, 1e-6);
  };
  std::optional<Stamp> moving_since;
  std::optional<Written> under_way;
  bool is_forecast_due = bag != nullptr;
  while (!simulator.is_finished()) {
    events.clear();
    simulator.step(std::nullopt, events);
    for (const SimulationEvent& event : events) {
      statistics.add(event);
      if (!bag) continue;
      write_messages(event, local, frames, [&](const std::string& topic, const auto& message) {
        bag->write(topic, event.published, message);
      });
    }
    if (is_forecast_due && simulator.progress() > 0.0) {
      const Written now{simulator.now(), simulator.progress(), bag->size()};
      if (!moving_since) moving_since = now.stamp;
      if (!under_way && to_seconds(now.stamp - *moving_since) >= kForecastAfter_s) under_way = now;
      if (under_way && to_seconds(now.stamp - under_way->stamp) >= kForecastAfter_s && now.done > under_way->done) {
        print_forecast(options, *under_way, now);
        is_forecast_due = false;
      }
    }
    std::ostringstream detail;
    detail << std::fixed << std::setprecision(0) << to_seconds(simulator.now() - begin) << " s simulated, "
           << std::setprecision(1) << real_time_factor() << " x real time";
    progress.report(static_cast<std::size_t>(1000.0 * simulator.progress()), detail.str());
  }
  progress.finish();
  if (bag) bag->close();

  const double simulated_s = to_seconds(simulator.now() - begin);
  const ReceiverSummary summary = statistics.summary();
  std::cout << std::fixed << std::setprecision(1) << "scenario        " << run.name << ", seed " << run.seed << ", "
            << simulated_s << " s, " << real_time_factor() << " x real time\n";
  std::cout << "written         " << (options.output.empty() ? "nothing (--output BAG)" : options.output) << '\n';
  print_summary(summary, std::cout);
  if (!options.json_file.empty()) {
    nlohmann::json json = to_json(summary);
    json["scenario"] = run.name;
    json["seed"] = run.seed;
    json["duration_s"] = simulated_s;
    write_file(options.json_file, inputs, [&](std::ostream& out) { out << json.dump(2) << '\n'; });
  }
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  CommandLine line("simulate",
                   "Drives a scenario offline: a bag of what the sensors publish, and how the receiver did.");
  line.app()
      .add_option("--scenario", options.scenario, "a scenario's file, or the name of one that comes with the package")
      ->required();
  line.add_output("--output", options.output, "bag to write");
  line.add_json(options.json_file);
  line.app().add_option("--seed", options.seed, "seed of all noise; default: the scenario's");
  line.add_duration(options.duration_s);
  line.app().add_option("--set", options.overrides, "one value, SECTION.NAME=VALUE; repeatable");
  line.app().add_flag("--without-lidar", options.without_lidar, "no scans, which take most of the time and of the bag");
  return line.run(argc, argv, [&] {
    line.reads(files_of_scenario(options.scenario));
    run(options, line.inputs());
  });
}
