// Monte Carlo of the simulation of Nishida et al., section 4: seeds x laps x methods, all on the same noise.

#include "urban_gnss_localization/experiments/paper_experiment.hpp"

#include <sys/utsname.h>

#include <array>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iomanip>
#include <iostream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <thread>

#include "command_line.hpp"
#include "files/output_file.hpp"
#include "find_scenario.hpp"
#include "parallel_jobs.hpp"
#include "urban_gnss_localization/evaluation/report_json.hpp"
#include "urban_gnss_localization/evaluation/statistics.hpp"
#include "urban_gnss_localization/parameters/assignment.hpp"
#include "urban_gnss_localization/parameters/parameter_list.hpp"
#include "urban_gnss_localization/parameters/parameter_reader.hpp"
#include "urban_gnss_localization/ros/plotting.hpp"

namespace fs = std::filesystem;
using namespace urban_gnss;

namespace {

constexpr double kDiverged_m = 5.0;
constexpr int kCurveStride = 10;  ///< steps between points of the curves over all seeds

struct Options {
  int seeds = 30;
  int first_seed = 1;
  int laps = 3;
  double noise_scale = -1.0;  ///< as configured
  std::string bias_direction;
  std::vector<std::string> methods;
  std::vector<std::string> overrides;
  std::string config;
  std::string json_file;
  std::string plots;
  bool open_loop = false;
  int jobs = 1;
};

/// Errors of one run, and the positions of its curve.
struct RunErrors {
  std::vector<double> position_m[2];  ///< sun, shadow
  std::vector<double> heading_rad[2];
  std::vector<double> cross_track_m;
  std::vector<double> curve_position_m;
  std::vector<double> curve_heading_rad;
  double worst_m = 0.0;
  double runtime_s = 0.0;
};

fs::path config_folder(const Options& options) {
  return options.config.empty() ? package_path() / "config" / "paper_field" : fs::path(options.config);
}

PaperExperimentConditions load_conditions(const Options& options) {
  const fs::path directory = config_folder(options);
  YAML::Node files;
  for (const char* name : kPaperFileNames) files[name] = load_map((directory / (std::string(name) + ".yaml")).string());
  for (const std::string& text : options.overrides) {
    const std::string file = text.substr(0, text.find_first_of(".="));
    if (!files[file].IsDefined()) throw std::runtime_error("--set " + text + ": there is no file " + file + ".yaml");
    assign(files, text);
  }
  if (!options.bias_direction.empty()) assign(files, "simulator.bias_direction=" + options.bias_direction);
  if (options.noise_scale >= 0.0) {
    for (const char* file : {"simulator", "particle_filter", "switching_particle_filter"}) {
      files[file]["expert"]["motion"]["odom_noise_scale"] = options.noise_scale;
    }
  }
  PaperExperimentConditions conditions = read_paper_conditions(files);
  conditions.laps = options.laps;
  conditions.closed_loop = !options.open_loop;
  return conditions;
}

std::vector<PaperMethod> select_methods(const std::vector<std::string>& names) {
  std::vector<PaperMethod> selected;
  for (const std::string& name : names) {
    const auto& all = paper_methods();
    const auto found = std::find_if(all.begin(), all.end(), [&](const auto& m) { return m.name == name; });
    if (found == all.end()) {
      std::string known;
      for (const auto& method : all) known += " " + method.name;
      throw std::runtime_error("--methods " + name + ": no such method; there are" + known);
    }
    selected.push_back(*found);
  }
  return selected;
}

/// Writes what the figures of one run need: the whole trajectory, and the particles at four places of the last lap.
class TraceWriter {
 public:
  TraceWriter(const fs::path& directory, const InputFiles& inputs, const std::string& method, int last_lap)
      : last_lap_(last_lap),
        trajectory_file_(directory / ("trajectory_" + method + ".csv"), inputs),
        snapshots_file_(directory / ("snapshots_" + method + ".csv"), inputs),
        particles_file_(directory / ("particles_" + method + ".csv"), inputs) {
    trajectory_ << "t,lap,true_x,true_y,true_yaw,est_x,est_y,est_yaw,fix_x,fix_y,in_shadow,bias_x,bias_y,radius,ess\n";
    snapshots_ << "snapshot,t,true_x,true_y,true_yaw,est_x,est_y,est_yaw,fix_x,fix_y,radius\n";
    particles_ << "snapshot,x,y,yaw,weight\n";
    for (std::ostream* out : {&trajectory_, &snapshots_, &particles_}) *out << std::setprecision(9);
  }

  void write(const PaperStep& s, const ParticleSet* particles) {
    const auto poses = [&](std::ostream& out) -> std::ostream& {
      out << s.truth.x << ',' << s.truth.y << ',' << s.truth.yaw << ',' << s.estimate.x << ',' << s.estimate.y << ','
          << s.estimate.yaw << ',' << s.fix.position.x() << ',' << s.fix.position.y() << ',';
      return out;
    };
    trajectory_ << s.time_s << ',' << s.lap << ',';
    poses(trajectory_) << s.fix.in_shadow << ',' << s.fix.bias.x() << ',' << s.fix.bias.y() << ',' << s.radius_m << ','
                       << s.effective_sample_size << '\n';
    const double bearing = std::atan2(s.truth.y, s.truth.x);
    if (particles != nullptr && s.lap == last_lap_ && next_ < kPlaces.size() &&
        std::abs(angle_difference(bearing, degrees_to_radians(kPlaces[next_]))) < degrees_to_radians(5.0)) {
      snapshots_ << next_ << ',' << s.time_s << ',';
      poses(snapshots_) << s.radius_m << '\n';
      for (std::size_t i = 0; i < particles->size(); ++i) {
        const Pose2 pose = particles->pose(i);
        particles_ << next_ << ',' << pose.x << ',' << pose.y << ',' << pose.yaw << ',' << particles->weight[i] << '\n';
      }
      ++next_;
    }
  }
  void close() {
    for (OutputFile* file : {&trajectory_file_, &snapshots_file_, &particles_file_}) file->close();
  }

 private:
  static constexpr std::array<double, 4> kPlaces{60.0, 110.0, 180.0, 250.0};  ///< deg, bearing from the origin
  int last_lap_;
  std::size_t next_ = 0;
  OutputFile trajectory_file_;
  OutputFile snapshots_file_;
  OutputFile particles_file_;
  std::ostream& trajectory_{trajectory_file_.stream()};
  std::ostream& snapshots_{snapshots_file_.stream()};
  std::ostream& particles_{particles_file_.stream()};
};

RunErrors run(const PaperMethod& method, PaperExperimentConditions conditions, int seed, TraceWriter* trace) {
  conditions.field.seed = seed;
  conditions.filter.seed = seed;
  conditions.switching.seed = seed;
  RunErrors errors;
  const auto start = std::chrono::steady_clock::now();
  int k = 0;
  run_paper_experiment(method, conditions, [&](const PaperStep& step, const ParticleSet* particles) {
    const double position = (step.estimate.position() - step.truth.position()).norm();
    const double heading = std::abs(angle_difference(step.estimate.yaw, step.truth.yaw));
    const int zone = step.fix.in_shadow ? 1 : 0;
    errors.position_m[zone].push_back(position);
    errors.heading_rad[zone].push_back(heading);
    errors.cross_track_m.push_back(step.cross_track_m);
    errors.worst_m = std::max(errors.worst_m, position);
    if (++k % kCurveStride == 0) {
      errors.curve_position_m.push_back(position);
      errors.curve_heading_rad.push_back(heading);
    }
    if (trace != nullptr) trace->write(step, particles);
  });
  errors.runtime_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return errors;
}

void append(std::vector<double>& all, const std::vector<double>& part) {
  all.insert(all.end(), part.begin(), part.end());
}

nlohmann::json zone_json(const std::vector<RunErrors>& runs, int zone) {
  std::vector<double> position;
  std::vector<double> heading;
  for (const RunErrors& run : runs) {
    append(position, run.position_m[zone]);
    append(heading, run.heading_rad[zone]);
  }
  const Summary p = summarize(std::move(position));
  const Summary h = summarize(std::move(heading));
  return {{"position_rmse_m", number_or_null(p.rmse)},  {"position_p95_m", number_or_null(p.p95)},
          {"position_max_m", number_or_null(p.max)},    {"position_median_m", number_or_null(p.median)},
          {"heading_rmse_rad", number_or_null(h.rmse)}, {"steps", p.count}};
}

nlohmann::json method_json(const PaperMethod& method, const std::vector<RunErrors>& runs) {
  std::vector<double> cross_track;
  double runtime = 0.0;
  int diverged = 0;
  for (const RunErrors& run : runs) {
    append(cross_track, run.cross_track_m);
    runtime += run.runtime_s;
    diverged += run.worst_m > kDiverged_m ? 1 : 0;
  }
  return {{"description", method.description},
          {"sun", zone_json(runs, 0)},
          {"shadow", zone_json(runs, 1)},
          {"diverged", diverged},
          {"cross_track_rmse_m", number_or_null(summarize(std::move(cross_track)).rmse)},
          {"seeds", runs.size()},
          {"cpu_s", runtime}};
}

void write_curves(std::ostream& out, const std::vector<RunErrors>& runs, double interval_s) {
  out << "t,position_rmse_m,position_p95_m,heading_rmse_rad\n" << std::setprecision(9);
  for (std::size_t i = 0;; ++i) {
    std::vector<double> position;
    std::vector<double> heading;
    for (const RunErrors& run : runs) {
      if (i >= run.curve_position_m.size()) continue;
      position.push_back(run.curve_position_m[i]);
      heading.push_back(run.curve_heading_rad[i]);
    }
    if (position.empty()) break;
    const Summary p = summarize(position);
    out << static_cast<double>((i + 1) * kCurveStride) * interval_s << ',' << p.rmse << ',' << p.p95 << ','
        << summarize(heading).rmse << '\n';
  }
}

void print_table(const nlohmann::json& metrics) {
  std::cout << std::left << std::setw(22) << "method" << std::right << std::setw(10) << "diverged" << std::setw(10)
            << "sun" << std::setw(10) << "shadow" << std::setw(12) << "shadow 95%" << std::setw(12) << "shadow max"
            << std::setw(12) << "heading" << std::setw(13) << "cross-track\n"
            << std::left << std::setw(22) << "" << std::right << std::setw(10) << "seeds" << std::setw(10) << "RMSE m"
            << std::setw(10) << "RMSE m" << std::setw(12) << "m" << std::setw(12) << "m" << std::setw(12) << "RMSE deg"
            << std::setw(13) << "RMSE m\n";
  const auto value = [](const nlohmann::json& v) {
    std::ostringstream text;
    if (v.is_null()) return std::string("-");
    text << std::fixed << std::setprecision(v.get<double>() < 100.0 ? 3 : 1) << v.get<double>();
    return text.str();
  };
  for (const auto& name : metrics["method_order"]) {
    const auto& m = metrics["methods"][name.get<std::string>()];
    const auto& heading = m["shadow"]["heading_rmse_rad"];
    std::cout << std::left << std::setw(22) << name.get<std::string>() << std::right << std::setw(10)
              << std::to_string(m["diverged"].get<int>()) + "/" + std::to_string(m["seeds"].get<int>()) << std::setw(10)
              << value(m["sun"]["position_rmse_m"]) << std::setw(10) << value(m["shadow"]["position_rmse_m"])
              << std::setw(12) << value(m["shadow"]["position_p95_m"]) << std::setw(12)
              << value(m["shadow"]["position_max_m"]) << std::setw(12)
              << (heading.is_null() ? "-" : value(radians_to_degrees(heading.get<double>()))) << std::setw(12)
              << value(m["cross_track_rmse_m"]) << '\n';
  }
}

std::string machine() {
  utsname name{};
  uname(&name);
  std::ifstream cpus("/proc/cpuinfo");
  std::string model;
  for (std::string line; model.empty() && std::getline(cpus, line);) {
    if (line.rfind("model name", 0) == 0) model = line.substr(line.find(':') + 2);
  }
  return std::string(name.sysname) + " " + name.machine + ", " + (model.empty() ? "unknown processor" : model) + ", " +
         std::to_string(std::thread::hardware_concurrency()) + " threads";
}

using Results = std::vector<std::vector<RunErrors>>;  ///< by method and seed

/// Every method on every seed; a method's first run leaves its trace in `data` where there are to be plots.
Results run_methods(const Options& options, const PaperExperimentConditions& conditions,
                    const std::vector<PaperMethod>& methods, const fs::path& data, const InputFiles& inputs) {
  const auto seeds = static_cast<std::size_t>(options.seeds);
  Results results(methods.size(), std::vector<RunErrors>(seeds));
  run_jobs(
      methods.size() * seeds, options.jobs, [&](std::size_t job) { return methods[job / seeds].name; },
      [&](std::size_t job, const std::function<void(double)>& on_progress) {
        const std::size_t m = job / seeds;
        const std::size_t s = job % seeds;
        std::unique_ptr<TraceWriter> trace;
        if (s == 0 && !options.plots.empty()) {
          trace = std::make_unique<TraceWriter>(data, inputs, methods[m].name, options.laps - 1);
        }
        results[m][s] = run(methods[m], conditions, options.first_seed + static_cast<int>(s), trace.get());
        if (trace) trace->close();
        on_progress(1.0);
      });
  return results;
}

nlohmann::json conditions_json(const PaperExperimentConditions& conditions) {
  const auto texts = [](const ParameterList& list) {
    nlohmann::json json;
    for (const ListedParameter& each : list.parameters()) {
      if (each.value.front() != '[') json[each.name] = each.value;
    }
    return json;
  };
  return {
      {"simulator", texts(ParameterList().add(conditions.field).add(conditions.field_motion))},
      {"particle_filter", texts(ParameterList().add(conditions.filter).add(conditions.filter_motion))},
      {"switching_particle_filter", texts(ParameterList().add(conditions.switching).add(conditions.switching_motion))},
      {"gps_bias", texts(ParameterList().add(conditions.bias))},
      {"waypoint_controller", texts(ParameterList().add(conditions.controller))}};
}

void write_plots(const Options& options, const PaperExperimentConditions& conditions,
                 const std::vector<PaperMethod>& methods, const Results& results, const fs::path& data,
                 const InputFiles& inputs) {
  write_file(data / "targets.csv", inputs, [&](std::ostream& out) {
    out << "x,y\n";
    for (const auto& target : conditions.controller.target_points()) out << target.x() << ',' << target.y() << '\n';
  });
  for (std::size_t m = 0; m < methods.size(); ++m) {
    write_file(data / ("errors_over_seeds_" + methods[m].name + ".csv"), inputs,
               [&](std::ostream& out) { write_curves(out, results[m], conditions.field.interval); });
  }
  run_plotter("plot_paper_experiment.py", options.plots);
}

void run_all(const Options& options, const std::string& command, const InputFiles& inputs) {
  const PaperExperimentConditions conditions = load_conditions(options);
  const std::vector<PaperMethod> methods = select_methods(options.methods);
  const fs::path data = fs::path(options.plots) / "data";
  const auto start = std::chrono::steady_clock::now();
  const Results results = run_methods(options, conditions, methods, data, inputs);

  nlohmann::json metrics;
  metrics["command"] = command;
  metrics["machine"] = machine();
  metrics["wall_s"] = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  metrics["closed_loop"] = conditions.closed_loop;
  metrics["laps"] = options.laps;
  for (int s = 0; s < options.seeds; ++s) metrics["seeds"].push_back(options.first_seed + s);
  metrics["conditions"] = conditions_json(conditions);
  for (std::size_t m = 0; m < methods.size(); ++m) {
    metrics["method_order"].push_back(methods[m].name);
    metrics["methods"][methods[m].name] = method_json(methods[m], results[m]);
  }
  print_table(metrics);
  const auto write_json = [&](const fs::path& file) {
    write_file(file, inputs, [&](std::ostream& out) { out << metrics.dump(2) << '\n'; });
  };
  if (!options.json_file.empty()) write_json(options.json_file);
  if (options.plots.empty()) return;
  write_json(fs::path(options.plots) / "metrics.json");
  write_plots(options, conditions, methods, results, data, inputs);
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  options.methods = {"paper", "conventional", "literal", "dead_reckoning", "oracle"};
  CommandLine line(
      "paper_experiment",
      "Monte Carlo of the simulation of Nishida et al. (2013), section 4: every method on the same noise.");
  CLI::App& app = line.app();
  line.add_seeds(options.seeds, options.first_seed);
  app.add_option("--laps", options.laps, "rounds over the eight targets")->check(CLI::PositiveNumber);
  app.add_option("--noise-scale", options.noise_scale, "factor on the variances of eq. (5)-(7), robot and filters")
      ->check(CLI::NonNegativeNumber);
  app.add_option("--bias-direction", options.bias_direction, "where the bias points in the shadow")
      ->check(CLI::IsMember({"random", "negative_x"}));
  app.add_option("--methods", options.methods, "comma-separated, or 'all'")->delimiter(',');
  line.add_set("--set", options.overrides, "FILE. and a parameter of a file in the folder of --config");
  app.add_option("--config", options.config, "folder of the YAML files; default: config/paper_field");
  line.add_json(options.json_file);
  line.add_output_folder("--plots", options.plots, "write report, figures and their data into this folder");
  app.add_flag("--open-loop", options.open_loop, "steer on the truth instead of the estimate");
  line.add_jobs(options.jobs);
  return line.run(argc, argv, [&] {
    if (options.methods == std::vector<std::string>{"all"}) {
      options.methods.clear();
      for (const auto& method : paper_methods()) options.methods.push_back(method.name);
    }
    line.reads(config_folder(options));
    run_all(options, line.command(), line.inputs());
  });
}
