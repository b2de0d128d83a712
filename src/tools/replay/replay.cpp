#include "replay.hpp"

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <iomanip>
#include <iostream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "command_line.hpp"
#include "files/output_file.hpp"
#include "find_scenario.hpp"
#include "replay_inputs.hpp"
#include "replay_run.hpp"
#include "replay_settings.hpp"
#include "several_recordings.hpp"
#include "urban_gnss_localization/common/progress.hpp"
#include "urban_gnss_localization/evaluation/report_json.hpp"
#include "urban_gnss_localization/ros/conversions.hpp"

namespace urban_gnss {
namespace {

namespace fs = std::filesystem;

nlohmann::json to_json(const ReceiverRecording& receiver) {
  const ReceiverCounts& counts = receiver.counts;
  return {{"source", receiver.source},
          {"fixes", counts.fixes},
          {"solutions_without_fix", counts.no_fixes},
          {"velocities", counts.velocities},
          {"satellite_lists", counts.epochs},
          {"fixes_with_satellites", counts.fixes_with_satellites},
          {"fixes_with_residuals", counts.fixes_with_residuals},
          {"unreadable_messages", receiver.unreadable}};
}

void print_receiver(const ReceiverRecording& receiver) {
  const ReceiverCounts& counts = receiver.counts;
  std::cout << "receiver " << receiver.source << '\n'
            << "  " << counts.fixes << " fixes (" << counts.fixes_with_satellites << " with satellites, "
            << counts.fixes_with_residuals << " with residuals), " << counts.velocities << " velocities, "
            << counts.no_fixes << " solutions without a fix, " << receiver.unreadable << " unreadable messages\n";
}

void print_occlusion(const nlohmann::json& report, const std::string& topic) {
  const auto& clouds = report["clouds"];
  const auto& fixes = report["fixes"];
  const auto& satellites = report["satellites"];
  std::cout << "occlusion: " << clouds["in_map"] << " of " << clouds["received"] << " clouds of " << topic
            << " in the map";
  for (const auto& [reason, count] : clouds["left_out"].items()) std::cout << "; " << count << " left out: " << reason;
  std::cout << "\n  " << fixes["weighed"] << " fixes weighed: " << fixes["with_map"] << " by the map, "
            << fixes["widened"] << " widened, " << fixes["bad"] << " bad, " << fixes["doubted"] << " doubted; "
            << satellites["judged"] << " satellites judged: " << satellites["free"] << " free, "
            << satellites["blocked"] << " blocked, " << satellites["unknown"] << " unknown\n";
  for (const auto& [missing, count] : fixes["missing"].items()) {
    std::cout << "  " << count << " fixes without " << missing << '\n';
  }
}

void print_summary(const ReplayRun& replay, const nlohmann::json& metrics, double wall_s, double bag_s) {
  std::cout << replay.estimates() << " estimates in " << std::fixed << std::setprecision(2) << wall_s << " s ("
            << std::setprecision(0) << bag_s / std::max(wall_s, 1e-3) << " times real time)\n";
  std::cout << "fixes:";
  for (const auto& [decision, count] : replay.decisions()) std::cout << "  " << decision << " " << count;
  std::cout << '\n';
  for (const auto& [kind, texts] : replay.rejections().kinds()) {
    std::cout << "  " << texts.count << " times " << texts.first << '\n';
  }
  const LocalizationReport report = replay.pipeline().report();
  std::cout << "at the end: " << to_string(report.state) << (report.healthy ? ", healthy" : ", not healthy: ")
            << (report.healthy ? "" : report.reason) << '\n';
  if (!metrics.contains("errors")) return;
  const auto& errors = metrics["errors"];
  const auto print = [](const nlohmann::json& value, double factor = 1.0) {
    if (value.is_null()) {
      std::cout << '-';
    } else {
      std::cout << factor * value.get<double>();
    }
  };
  if (errors["position_m"]["median"].is_null()) return;
  std::cout << std::setprecision(2) << "position error, m";
  constexpr std::pair<const char*, const char*> kShown[] = {
      {": median ", "median"}, {", mean ", "mean"}, {", 95 % ", "p95"}, {", max ", "max"}};
  for (const auto& [name, key] : kShown) {
    std::cout << name;
    print(errors["position_m"][key]);
  }
  std::cout << "; the truth was covered to ";
  print(errors["coverage"], 100.0);
  std::cout << " %\n";
}

/// "drive_0.bag, drive_1.bag".
std::string names_of_inputs(const ReplayOptions& options) {
  std::string names;
  for (const std::string& bag : options.bags) names += (names.empty() ? "" : ", ") + fs::path(bag).filename().string();
  return names.empty() ? fs::path(options.nmea).filename().string() : names;
}

nlohmann::json metrics_of(const ReplayOptions& options, const ReplaySettings& settings, ReplayRun& replay) {
  const LocalizationReport report = replay.pipeline().report();
  nlohmann::json metrics = {{"bag", names_of_inputs(options)},
                            {"localizer", replay.pipeline().localizer().name()},
                            {"mode", replay.pipeline().localizer().mode()},
                            {"seed", settings.seed},
                            {"estimates", replay.estimates()},
                            {"decisions", replay.decisions()},
                            {"fixes_with_ranges", report.fixes_with_ranges},
                            {"velocities_used", report.velocities_used}};
  metrics["final_state"] = to_string(report.state);
  if (const auto& frame = replay.pipeline().frame()) {
    metrics["datum"] = {frame->datum().latitude_deg, frame->datum().longitude_deg, frame->datum().altitude_m};
  }
  metrics["time_to_start_s"] = number_or_null(replay.time_to_start_s());
  metrics["time_to_heading_s"] = number_or_null(replay.time_to_heading_s());
  if (const auto reference = replay.take_truth()) {
    metrics["errors"] = to_json(errors_at_truth(*reference, replay.estimate()).summary);
  }
  return metrics;
}

/// Throws std::runtime_error where the other options leave nothing to weigh, or nothing to build a map with.
void check_occlusion(const ReplayOptions& options) {
  if (options.without_odometry) {
    throw std::runtime_error("--occlusion needs odometry, in whose frame the map is built: --odom none has none");
  }
  if (without_leading_slash(options.fix_topic) == topics::kWeightedFix) {
    throw std::runtime_error("--fix-topic: the fixes of gps/fix_weighted are weighed already; give the receiver's");
  }
}

/// The results as JSON, which stand on standard output, too. Throws std::runtime_error where there is no estimate.
nlohmann::json run(const ReplayOptions& options, const LocalizerRegistry& localizers, const InputFiles& files) {
  const ReplaySettings settings = read_settings(options, localizers);
  ReplayInputs inputs(options);

  // Where nobody tells how the robot lies in the odometry's frame, the odometry does.
  const bool odometry_is_tf = settings.occlusion && !inputs.has_transforms_from(settings.occlusion->frames.odom);
  ReplayRun replay(options, settings, files, {inputs.truths(), inputs.odometries(), odometry_is_tf});
  Progress progress(inputs.size(), "messages");
  const auto start = std::chrono::steady_clock::now();
  std::size_t done = 0;
  while (inputs.give_next(replay)) progress.report(++done);
  progress.finish();
  replay.finish();
  const double wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();

  nlohmann::json metrics = metrics_of(options, settings, replay);
  if (options.without_odometry) metrics["odometry"] = "constant-velocity model";
  const std::optional<ReceiverRecording> receiver = inputs.receiver();
  if (receiver) metrics["receiver"] = to_json(*receiver);
  if (replay.occlusion()) metrics["occlusion"] = replay.occlusion()->report();
  if (!options.json_file.empty()) {
    write_file(options.json_file, files, [&](std::ostream& out) { out << metrics.dump(2) << '\n'; });
  }
  print_summary(replay, metrics, wall_s, inputs.duration_s());
  if (receiver) print_receiver(*receiver);
  if (replay.occlusion()) {
    print_occlusion(metrics["occlusion"], options.points_topic);
    if (odometry_is_tf)
      std::cout << "  no tf from " << settings.occlusion->frames.odom << ": the odometry's poses are used\n";
  }
  if (options.without_odometry) {
    std::cout << "no odometry: constant-velocity model, of the receiver's "
              << (receiver->counts.velocities > 0 ? "velocities" : "fixes") << "; the yaw is the course over ground\n";
  }
  if (replay.estimates() == 0) {
    const std::string missing = replay.pipeline().waiting_for();
    throw std::runtime_error("no estimate: " +
                             (missing.empty() ? "nothing came after the start" : "still waiting for " + missing));
  }
  return metrics;
}

/// "19787 estimates; 1978 accepted, 16 not_examined; position error median 0.83, 95 % 2.17 m".
std::string line_of(const nlohmann::json& metrics) {
  std::ostringstream line;
  line << metrics["estimates"] << " estimates";
  const char* separator = "; ";
  for (const auto& [decision, count] : metrics["decisions"].items()) {
    line << separator << count << ' ' << decision;
    separator = ", ";
  }
  if (!metrics.contains("errors")) return line.str();
  const auto& position = metrics["errors"]["position_m"];
  if (!position["median"].is_number() || !position["p95"].is_number()) return line.str();
  line << std::fixed << std::setprecision(2) << "; position error median " << position["median"].get<double>()
       << ", 95 % " << position["p95"].get<double>() << " m";
  return line.str();
}

/// Each bag for itself; throws std::runtime_error where one of them failed.
void run_each(const ReplayOptions& options, int jobs, const LocalizerRegistry& localizers, const InputFiles& files) {
  if (!(options.output + options.json_file + options.tum_file).empty()) require_names_of_their_own(options.bags);
  const auto names = [&](const std::string& folder, const char* extension) {
    return folder.empty() ? std::vector<std::string>(options.bags.size())
                          : files_beside(folder, options.bags, extension);
  };
  const auto outputs = names(options.output, ".bag");
  const auto jsons = names(options.json_file, ".json");
  const auto tums = names(options.tum_file, ".tum");
  std::size_t failed = 0;
  const auto work = [&](std::size_t i) {
    ReplayOptions one = options;
    one.bags = {options.bags[i]};
    one.output = outputs[i];
    one.json_file = jsons[i];
    one.tum_file = tums[i];
    return line_of(run(one, localizers, files));
  };
  run_in_processes(options.bags.size(), jobs, work, [&](std::size_t i, const RecordingResult& result) {
    if (result.is_done) {
      std::cout << options.bags[i] << ": " << result.text << std::endl;
    } else {
      ++failed;
      std::cerr << "replay: " << result.text
                << (result.text.find(options.bags[i]) == std::string::npos ? " (read: " + options.bags[i] + ")" : "")
                << std::endl;
    }
  });
  if (failed > 0) {
    throw std::runtime_error(std::to_string(failed) + " of " + std::to_string(options.bags.size()) + " bags failed");
  }
}

void print_variants(const LocalizerRegistry& localizers) {
  for (const LocalizerVariant& variant : localizers.variants()) std::cout << variant.name << '\n';
}

}  // namespace

int replay_main(int argc, char** argv, const LocalizerRegistry& localizers) {
  ReplayOptions options;
  CommandLine line("replay",
                   "Runs a bag through a localizer offline; the same input, parameters and seed give the same output.");
  CLI::App& app = line.app();
  app.add_option("bag", options.bags, "the bag to read; several are parts of one recording, but with --jobs");
  bool only_names = false;
  bool only_receivers = false;
  std::string odometry = "topic";
  app.add_flag("--list-variants", only_names, "print the names under which localizers are compared, and end");
  app.add_option("--localizer", options.localizer,
                 localizers.names() + "; in comparisons also as " + localizers.variant_names())
      ->check([&localizers](const std::string& name) {
        try {
          localizers.choose(name);
        } catch (const std::runtime_error& error) {
          return std::string(error.what());
        }
        return std::string();
      });
  app.add_option("--robot", options.robot, "differential, ackermann, holonomic or car: what is known of its wheels");
  app.add_option("--params", options.params,
                 "YAML with a section for each node, as for localization.launch; repeatable, later files win");
  line.add_set(
      "--set", options.overrides,
      "a parameter of the localizer, or after gps_bias. of the bias filter, after occlusion. of occlusion_node");
  line.add_output("--output", options.output,
                  "bag to write: odometry/filtered, gps/filtered, gps/fix, gps/datum, gps/bias, status, tf; with "
                  "--occlusion gps/fix_weighted and gps/visibility too");
  app.add_option("--fix-topic", options.fix_topic, "sensor_msgs/NavSatFix");
  app.add_option("--odom-topic", options.odom_topic, "nav_msgs/Odometry");
  const auto* velocity_topic = app.add_option(
      "--velocity-topic", options.velocity_topic,
      "the receiver's velocity, east and north: " + std::string(kVelocityTypes) + ", where the bag has it; \"\": none");
  const auto* imu_topic = app.add_option("--imu-topic", options.imu_topic,
                                         "sensor_msgs/Imu whose yaw rate is used instead of the odometry's, where the "
                                         "bag has it; \"\": none");
  const auto* satellites_topic = app.add_option("--satellites-topic", options.satellites_topic,
                                                "urban_gnss_localization/SatelliteArray, whose residuals tell the "
                                                "ranges of a fix, where the bag has it; \"\": none");
  app.add_option("--receiver", options.receiver,
                 "whose messages tell fix, velocity and satellites: " + receiver_preset_names() +
                     "; navsatfix: --fix-topic and the other two");
  app.add_flag("--list-receivers", only_receivers,
               "print receiver, driver, topic, types and use, separated by tabs, and end");
  app.add_option("--receiver-ns", options.receiver_ns, "namespace of the receiver's topics; default: found in the bag");
  app.add_option("--odom", odometry,
                 "topic: of --odom-topic; none: a constant-velocity model, of what the receiver says of its motion")
      ->check(CLI::IsMember({"topic", "none"}));
  app.add_option("--nmea", options.nmea,
                 "log of NMEA 0183 in place of the bag's fixes, velocities and satellites; its stamps are UTC");
  app.add_option("--nmea-date", options.nmea_date, "YYYY-MM-DD of its first sentence, in place of the log's own dates");
  int jobs = 0;
  const auto* each = app.add_option("--jobs", jobs,
                                    "each bag is a recording of its own, so many of them at a time; --output, --json "
                                    "and --tum are folders then, for a file of each bag's name")
                         ->check(CLI::PositiveNumber)
                         ->excludes("--nmea");
  auto* occlusion = app.add_flag("--occlusion", options.occlusion,
                                 "the localizer gets the fixes as occlusion_node weighs them, by the bag's point "
                                 "clouds, tf and satellites (docs/occlusion.md)");
  app.add_option("--points-topic", options.points_topic, "sensor_msgs/PointCloud2 of the lidar")->needs(occlusion);
  app.add_option("--occlusion-params", options.occlusion_params,
                 "YAML of occlusion_node alone, as occlusion.launch takes it; before --params and --set")
      ->needs(occlusion);
  app.add_option("--truth-topic", options.truth_topic, "nav_msgs/Odometry, for the errors only");
  app.add_option("--datum", options.datum,
                 "LAT,LON,ALT (deg, deg, m); default: the bag's gps/datum, or the first fixes")
      ->delimiter(',')
      ->expected(3);
  app.add_option("--start", options.start_s, "s into the bag, from where it is read")->check(CLI::NonNegativeNumber);
  app.add_option("--duration", options.duration_s, "s of the bag that are read; default: all")
      ->check(CLI::PositiveNumber);
  app.add_option("--seed", options.seed, "seed of the random numbers; default: as in the parameters");
  line.add_json(options.json_file);
  line.add_output("--tum", options.tum_file, "write the trajectory here (TUM format, ENU about the datum)");
  line.outputs_are_folders_with(each);
  return line.run(argc, argv, [&] {
    if (only_names) return print_variants(localizers);
    if (only_receivers) {
      std::cout << describe_receiver_presets();
      return;
    }
    if (options.bags.empty() && options.nmea.empty()) throw std::runtime_error("which bag? See --help");
    if (options.bags.empty() && odometry != "none") {
      throw std::runtime_error("--nmea needs a bag with odometry, or --odom none");
    }
    options.wants_velocity = velocity_topic->count() > 0 && !options.velocity_topic.empty();
    options.wants_satellites = satellites_topic->count() > 0 && !options.satellites_topic.empty();
    options.wants_imu = imu_topic->count() > 0 && !options.imu_topic.empty();
    options.without_odometry = odometry == "none";
    if (options.occlusion) check_occlusion(options);
    if (!options.robot.empty()) line.reads(package_path() / "config" / "robots");
    if (each->count() > 0) return run_each(options, jobs, localizers, line.inputs());
    run(options, localizers, line.inputs());
  });
}

}  // namespace urban_gnss
