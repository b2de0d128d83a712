#pragma once

#include <optional>
#include <string>

#include "receiver_recording.hpp"
#include "urban_gnss_localization/receivers/nmea_decoder.hpp"

namespace urban_gnss {

/// A log of NMEA 0183 without ROS.
struct NmeaLog {
  ReceiverOutput output;  ///< stamps are UTC
  NmeaCounts counts;
};

/// The log solution by solution, each at its stamp.
ReceiverRecording to_recording(const NmeaLog& log, const std::string& source);

/// "29 solutions (29 fixes, 29 velocities, 29 lists of satellites) of 928 sentences; 3 lines refused: …".
std::string summary_of(const NmeaLog& log);

/// YYYY-MM-DD. Throws std::runtime_error where it is no date.
Day parse_date(const std::string& text);

/// Decodes a whole file. `first_day` is the day of its first sentence, in place of the dates that it has; without it
/// the first date that comes with a fix tells the day of all before it. A log without any date is of 1970-01-01, and a
/// warning says so. Throws std::runtime_error where the file cannot be read, or has no sentence.
NmeaLog read_nmea_log(const std::string& file, std::optional<Day> first_day, const NmeaParameters& parameters = {});

/// The same as it comes live, when each line has an arrival stamp: its number in the file, in nanoseconds. For
/// comparing line by line.
NmeaLog read_nmea_log_by_lines(const std::string& file, const NmeaParameters& parameters = {});

}  // namespace urban_gnss
