// sigma_URE and the C/N0 of free signals of a receiver that stands still under a free sky, as parameters of
// occlusion_node.

#include <algorithm>
#include <iomanip>
#include <iostream>
#include <map>
#include <sstream>

#include "command_line.hpp"
#include "files/bag_reader.hpp"
#include "files/output_file.hpp"
#include "replay/bag_receiver.hpp"
#include "replay/nmea_log.hpp"
#include "urban_gnss_localization/geometry/angles.hpp"
#include "urban_gnss_localization/geometry/local_frame.hpp"
#include "urban_gnss_localization/gnss/cn0_curve.hpp"
#include "urban_gnss_localization/gnss/fix_validation.hpp"
#include "urban_gnss_localization/gnss/stationary_part.hpp"
#include "urban_gnss_localization/gnss/ure_calibration.hpp"

using namespace urban_gnss;

namespace {

/// Share of the fixes that must be of the part in which the receiver stands.
constexpr double kMostly = 0.95;
/// Below it, the fixes say too little of their own.
constexpr double kFewIndependent = 10.0;
/// Of residuals over fixes. Above it the ranges have more than noise.
constexpr double kReflections = 10.0;

struct Options {
  ReplayOptions replay;
  double max_hdop{2.0};
  std::vector<double> place;
  std::string yaml_file;
};

/// What a recording says of a receiver, in the order of the stamps.
struct Recording {
  std::string source;
  std::vector<RawFix> fixes;
  std::vector<RawVelocity> velocities;
  std::map<Stamp, std::vector<SatelliteObservation>> satellites;
};

ReceiverRecording read_receiver(const ReplayOptions& options) {
  if (!options.nmea.empty()) {
    const auto day = options.nmea_date.empty() ? std::nullopt : std::optional<Day>(parse_date(options.nmea_date));
    return to_recording(read_nmea_log(options.nmea, day), options.nmea);
  }
  const BagReader bag(options.bags);
  const bool is_decoded = find_receiver_preset(options.receiver).make != nullptr;
  ReceiverRecording recording = is_decoded ? decode_receiver(bag, options) : read_receiver_topics(bag, options);
  if (recording.counts.fixes == 0 || recording.counts.epochs == 0) {
    throw std::runtime_error(bag.name() + " has " + std::to_string(recording.counts.fixes) + " fixes and " +
                             std::to_string(recording.counts.epochs) + " lists of satellites in " + recording.source +
                             "; see --fix-topic, --satellites-topic and --receiver; it has" + bag.topics());
  }
  return recording;
}

/// The part that --start and --duration ask for.
Recording read(const ReplayOptions& options) {
  const ReceiverRecording all = read_receiver(options);
  Recording recording;
  recording.source = all.source;
  if (all.outputs.empty()) throw std::runtime_error(all.source + ": no fix, no velocity and no satellites");
  const Stamp first = all.outputs.front().time;
  for (const TimedOutput& each : all.outputs) {
    const double into_s = to_seconds(each.time - first);
    if (into_s < options.start_s || into_s > options.start_s + options.duration_s) continue;
    const ReceiverOutput& output = each.output;
    for (const RawFix& fix : output.fixes) {
      if (!is_usable_position(fix)) continue;
      recording.fixes.push_back(fix);
      if (!is_altitude(fix.position.altitude_m))
        recording.fixes.back().position.altitude_m = 0.0;  // plane errors alone
    }
    recording.velocities.insert(recording.velocities.end(), output.velocities.begin(), output.velocities.end());
    for (const SatelliteEpoch& epoch : output.satellites) recording.satellites[epoch.stamp] = epoch.satellites;
  }
  const auto by_stamp = [](const auto& a, const auto& b) { return a.stamp < b.stamp; };
  std::stable_sort(recording.fixes.begin(), recording.fixes.end(), by_stamp);
  std::stable_sort(recording.velocities.begin(), recording.velocities.end(), by_stamp);
  if (recording.fixes.empty()) throw std::runtime_error(all.source + ": no fix with a position in this part");
  return recording;
}

std::string seconds(Stamp stamp, Stamp first) {
  std::ostringstream text;
  text << std::fixed << std::setprecision(0) << to_seconds(stamp - first);
  return text.str();
}

/// Throws std::runtime_error where the receiver moves, and says where it stands.
StationaryPart require_stationary(const Recording& recording, const std::vector<TimedPosition>& places,
                                  double start_s) {
  const auto part = longest_stationary_part(places, recording.velocities);
  const Stamp first = recording.fixes.front().stamp;
  const auto still = std::count_if(places.begin(), places.end(), [&](const TimedPosition& each) {
    return part && each.stamp >= part->begin && each.stamp <= part->end;
  });
  if (still >= kMostly * static_cast<double>(places.size())) return *part;
  std::string hint = "; it never stands";
  if (part && part->duration_s() > 0.0) {
    const Stamp origin = first - from_seconds(start_s);
    hint = "; it stands longest with --start " + seconds(part->begin, origin) + " --duration " +
           seconds(part->end, part->begin);
  }
  throw std::runtime_error(recording.source + ": the receiver is not stationary" + hint);
}

struct Calibration {
  UreCalibration ure;
  Cn0Curve cn0;

  /// The larger of what fixes and residuals say: each has errors that it does not see.
  double sigma_m() const { return std::max(ure.sigma_m, ure.residual_sigma_m.value_or(0.0)); }
};

Calibration calibrate(const Options& options) {
  const Recording recording = read(options.replay);
  const LocalFrame frame(recording.fixes.front().position);
  std::vector<TimedPosition> places;
  for (const RawFix& fix : recording.fixes) places.push_back({fix.stamp, frame.to_local(fix.position).head<2>()});
  const StationaryPart part = require_stationary(recording, places, options.replay.start_s);
  std::vector<StationaryFix> fixes;
  std::vector<SatelliteObservation> signals;
  for (const TimedPosition& each : places) {
    if (each.stamp < part.begin || each.stamp > part.end) continue;
    const auto epoch = recording.satellites.find(each.stamp);
    fixes.push_back({each.stamp, each.position, {}});
    if (epoch == recording.satellites.end()) continue;
    fixes.back().satellites = epoch->second;
    signals.insert(signals.end(), epoch->second.begin(), epoch->second.end());
  }
  UreCalibrationSettings settings;
  settings.max_hdop = options.max_hdop;
  if (!options.place.empty()) {
    const double altitude_m = recording.fixes.front().position.altitude_m;
    settings.place = frame.to_local({options.place[0], options.place[1], altitude_m}).head<2>();
  }
  return {calibrate_ure(fixes, settings), fit_cn0_curve(signals)};
}

void describe(const Calibration& found, std::ostream& out) {
  const UreCalibration& ure = found.ure;
  out << std::fixed << std::setprecision(2) << "sigma_URE by " << ure.fixes << " fixes in " << std::setprecision(0)
      << ure.duration_s << " s, HDOP " << std::setprecision(2) << ure.median_hdop << ": " << ure.sigma_m
      << " m, give or take " << std::setprecision(0) << 100.0 * ure.relative_error << " % (errors last "
      << std::setprecision(1) << ure.error_lasts_s << " s: as many as " << std::setprecision(0)
      << ure.independent_errors << " independent fixes)\n";
  if (ure.residual_sigma_m) {
    out << "sigma_URE by " << ure.residuals << " residuals of ranges: " << std::setprecision(2) << *ure.residual_sigma_m
        << " m\n";
  } else {
    out << "no residuals of ranges\n";
  }
  out << "C/N0 by " << found.cn0.signals << " signals of " << found.cn0.satellites << " satellites:\n"
      << "elevation  signals  median  lower decile\n";
  for (const Cn0Band& band : found.cn0.bands) {
    out << std::setprecision(0) << std::setw(5) << radians_to_degrees(band.from_rad) << '-' << std::left << std::setw(3)
        << radians_to_degrees(band.to_rad) << std::right << std::setw(9) << band.signals << std::setprecision(1)
        << std::setw(8) << band.median_dbhz << std::setw(14) << band.lower_decile_dbhz << '\n';
  }
}

void warn(const Calibration& found) {
  if (found.ure.independent_errors < kFewIndependent) {
    std::cerr << "warning: the fixes' errors last too long for this recording: sigma_URE by fixes is a lower bound; "
                 "record for hours, or give --place\n";
  }
  if (found.sigma_m() > kReflections * found.ure.sigma_m) {
    std::cerr << "warning: the residuals say much more than the fixes, as reflections do: is the sky free?\n";
  }
  if (!found.cn0.has_rise) std::cerr << "warning: all satellites are of about one elevation: no nlos_cn0_rise\n";
}

/// The parameters of occlusion_node.
void write_yaml(const Calibration& found, const std::string& command, std::ostream& out) {
  const UreCalibration& ure = found.ure;
  out << std::fixed << std::setprecision(2) << "# By: " << command << '\n'
      << "sigma_ure: " << found.sigma_m() << "  # m, by fixes " << ure.sigma_m << ", by residuals ";
  (ure.residual_sigma_m ? out << *ure.residual_sigma_m : out << "unknown") << '\n';
  out << std::setprecision(1) << "expert:\n  covariance:\n    nlos_cn0: " << found.cn0.weak_dbhz()
      << "  # dB-Hz, at 37 degrees elevation; 1 % of the free signals are weaker\n    nlos:\n"
      << "      nlos_cn0_width: " << std::setprecision(2) << found.cn0.odds_width_db()
      << "  # dB, by the free signals' scatter of " << found.cn0.scatter_db << " dB\n";
  if (found.cn0.has_rise) out << std::setprecision(1) << "      nlos_cn0_rise: " << found.cn0.rise_db << "  # dB\n";
}

void run(const Options& options, const CommandLine& line) {
  const Calibration found = calibrate(options);
  describe(found, std::cerr);
  warn(found);
  if (options.yaml_file.empty()) {
    write_yaml(found, line.command(), std::cout);
  } else {
    write_file(options.yaml_file, line.inputs(), [&](std::ostream& out) { write_yaml(found, line.command(), out); });
  }
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  ReplayOptions& replay = options.replay;
  CommandLine line("calibrate_ure",
                   "sigma_URE and the C/N0 of free signals, from a receiver that stands still under a free sky (Maier "
                   "and Kleiner 2010, section IV.B); parameters of occlusion_node as YAML on standard output.");
  CLI::App& app = line.app();
  auto* bag = app.add_option("bag", replay.bags, "the bag to read; several are one recording");
  app.add_option("--fix-topic", replay.fix_topic, "sensor_msgs/NavSatFix");
  app.add_option("--satellites-topic", replay.satellites_topic, "urban_gnss_localization/SatelliteArray");
  app.add_option("--velocity-topic", replay.velocity_topic, "the receiver's velocity, where the bag has it");
  app.add_option("--receiver", replay.receiver,
                 "whose messages tell fix, velocity and satellites: " + receiver_preset_names() +
                     "; navsatfix: --fix-topic and the other two");
  app.add_option("--receiver-ns", replay.receiver_ns, "namespace of the receiver's topics; default: found in the bag");
  app.add_option("--nmea", replay.nmea, "log of NMEA 0183 in place of a bag");
  app.add_option("--nmea-date", replay.nmea_date, "YYYY-MM-DD of its first sentence, in place of the log's own dates");
  app.add_option("--start", replay.start_s, "s into the recording, from where it is read")
      ->check(CLI::NonNegativeNumber);
  app.add_option("--duration", replay.duration_s, "s that are read; default: all")->check(CLI::PositiveNumber);
  app.add_option("--max-hdop", options.max_hdop, "fixes with a larger HDOP are left out")->check(CLI::PositiveNumber);
  app.add_option("--place", options.place,
                 "LAT,LON (deg) of the antenna, where it is known; default: the mean of the fixes")
      ->delimiter(',')
      ->expected(2);
  line.add_output("--yaml", options.yaml_file, "write the parameters here, and not to standard output");
  return line.run(argc, argv, [&] {
    if (bag->count() == 0 && replay.nmea.empty()) throw std::runtime_error("which bag? See --help");
    run(options, line);
  });
}
