#include "nmea_log.hpp"

#include <algorithm>
#include <fstream>
#include <sstream>
#include <stdexcept>

#include "urban_gnss_localization/receivers/receiver_input.hpp"

namespace urban_gnss {
namespace {

std::string read_file(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  if (!file || !(text << file.rdbuf())) throw std::runtime_error(path + ": cannot be read, or is empty");
  return text.str();
}

/// The first moment whose date came with a fix, or in a ZDA where there is none.
std::optional<Stamp> first_moment(const std::vector<std::string_view>& lines) {
  std::optional<Stamp> without_fix;
  for (const std::string_view line : lines) {
    const NmeaParsing parsing = parse_nmea_sentence(line);
    if (!parsing.sentence) continue;
    const auto day = day_of(*parsing.sentence);
    const auto time = time_of_day(*parsing.sentence);
    if (!day || !time) continue;
    const Stamp moment = std::chrono::hours(24 * *day) + *time;
    if (parsing.sentence->type == "RMC" && parsing.sentence->field(1) == "A") return moment;
    if (parsing.sentence->type == "ZDA" && !without_fix) without_fix = moment;
  }
  return without_fix;
}

std::size_t fixes_in(const ReceiverOutput& output) {
  return static_cast<std::size_t>(
      std::count_if(output.fixes.begin(), output.fixes.end(), [](const RawFix& fix) { return fix.has_fix; }));
}

}  // namespace

ReceiverRecording to_recording(const NmeaLog& log, const std::string& source) {
  ReceiverRecording recording;
  recording.source = source;
  const ReceiverOutput& output = log.output;
  auto velocity = output.velocities.begin();
  auto epoch = output.satellites.begin();
  for (const RawFix& fix : output.fixes) {
    TimedOutput& timed = recording.outputs.emplace_back();
    timed.time = fix.stamp;
    timed.output.fixes.push_back(fix);
    if (velocity != output.velocities.end() && velocity->stamp == fix.stamp) {
      timed.output.velocities.push_back(*velocity++);
    }
    if (epoch != output.satellites.end() && epoch->stamp == fix.stamp) timed.output.satellites.push_back(*epoch++);
  }
  ReceiverCounter counter;
  for (const TimedOutput& each : recording.outputs) counter.add(each.output);
  recording.counts = counter.counts();
  return recording;
}

std::string summary_of(const NmeaLog& log) {
  std::ostringstream text;
  text << log.counts.solutions << " solutions (" << fixes_in(log.output) << " fixes, " << log.output.velocities.size()
       << " velocities, " << log.output.satellites.size() << " lists of satellites) of " << log.counts.sentences
       << " sentences";
  if (log.counts.without_time > 0) {
    text << "; " << log.counts.without_time << " solutions left out before the receiver knew the time";
  }
  if (log.counts.late_sentences > 0) text << "; " << log.counts.late_sentences << " late sentences left out";
  for (const auto& [refusal, count] : log.counts.refused) {
    text << "; " << count << " lines left out: " << to_string(refusal);
  }
  return text.str();
}

Day parse_date(const std::string& text) {
  if (text.size() == 10 && text[4] == '-' && text[7] == '-') {
    const auto year = to_count(text.substr(0, 4));
    const auto month = to_count(text.substr(5, 2));
    const auto day = to_count(text.substr(8, 2));
    const auto date = year && month && day ? to_day(*year, *month, *day) : std::nullopt;
    if (date) return *date;
  }
  throw std::runtime_error("\"" + text + "\" is no date: must be YYYY-MM-DD");
}

NmeaLog read_nmea_log(const std::string& file, std::optional<Day> first_day, const NmeaParameters& parameters) {
  const std::string text = read_file(file);
  const std::vector<std::string_view> lines = split_nmea_lines(text);
  const auto moment = first_day ? std::nullopt : first_moment(lines);
  const NmeaClock clock = moment ? NmeaClock::near(*moment) : NmeaClock::from_day(first_day.value_or(0));
  NmeaDecoder decoder(parameters, clock);
  for (const std::string_view line : lines) decoder.add(line);
  decoder.finish();
  NmeaLog log{decoder.take(), decoder.counts()};
  if (log.counts.sentences == 0) throw std::runtime_error(file + ": has no sentence of NMEA 0183 with its checksum");
  if (!moment && !first_day && log.counts.solutions > 0) {
    log.output.warnings.insert(log.output.warnings.begin(), "no date (RMC, ZDA): stamps count from 1970-01-01");
  }
  return log;
}

NmeaLog read_nmea_log_by_lines(const std::string& file, const NmeaParameters& parameters) {
  std::istringstream lines(read_file(file));
  NmeaDecoder decoder(parameters);
  Stamp number{0};
  for (std::string line; std::getline(lines, line);) decoder.add(line, ++number);
  decoder.finish();
  return {decoder.take(), decoder.counts()};
}

}  // namespace urban_gnss
