#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "urban_gnss_localization/receivers/nmea_clock.hpp"
#include "urban_gnss_localization/receivers/nmea_sentence.hpp"
#include "urban_gnss_localization/receivers/nmea_sky.hpp"
#include "urban_gnss_localization/receivers/nmea_solution.hpp"
#include "urban_gnss_localization/receivers/receiver_output.hpp"

namespace urban_gnss {

/// What became of sentences and solutions.
struct NmeaCounts {
  std::size_t sentences{0};                    ///< with a right checksum, of any type
  std::map<NmeaRefusal, std::size_t> refused;  ///< lines
  std::size_t solutions{0};                    ///< that were given out
  std::size_t without_time{0};                 ///< solutions that were left out: no stamp for them
  std::size_t late_sentences{0};               ///< left out: of a solution that had been given out before
};

/// Sentences of NMEA 0183 in, solutions out.
///
/// **What is one solution.** Sentences with the same time (GGA, RMC, GNS, GLL, GST, GRS, GBS; to 10 ms) are of one
/// solution. GSA, GSV, and VTG have no time: they are of the solution that is open, except where they begin the next
/// one, as some receivers send them first: where one of its kind comes a second time with a sentence with a time in
/// between, and, of sentences with arrival stamps, behind a pause of more than 0.3 of the interval between solutions.
///
/// **When it is complete.** When the next one begins, and at finish(). With arrival stamps also, without waiting, at
/// the sentence that ended the last three solutions, so that nothing waits a whole interval. Satellites that come
/// behind it are given out later, with the solution's stamp; where others had been given out already they are left out
/// and counted. For sixty solutions nothing then ends early.
///
/// **Its stamp.** With arrival stamps that of its first sentence with a time: the robot's clock. Without them UTC, by
/// the sentences' time and by date of RMC and ZDA. The clock of a receiver without a fix may be anything, so that
/// solutions without one are given out only if they follow, within a minute, one with a stamp.
class NmeaDecoder {
 public:
  explicit NmeaDecoder(const NmeaParameters& parameters = {}, const NmeaClock& clock = {});

  /// A line of a log or a message. Takes any bytes. `arrival`: by the robot's clock; give it with all lines or none.
  void add(std::string_view line, std::optional<Stamp> arrival = std::nullopt);
  /// What was completed since it was asked last.
  ReceiverOutput take();
  /// Nothing more comes: the last solution is complete.
  void finish();

  const NmeaCounts& counts() const { return counts_; }

 private:
  struct Solution {
    std::optional<Stamp> time;     ///< of day
    std::optional<Stamp> arrival;  ///< of the first sentence with a status or a time
    NmeaSolution content;
    NmeaSky sky;
    std::map<std::string, int> seen;    ///< how often sentences came, by their keys
    std::set<std::string> since_timed;  ///< keys without a time that came after the last sentence with one
    std::string last_key;
    std::optional<Stamp> stamp;  ///< once it is given out
    bool is_given_out{false};
    bool satellites_given_out{false};
  };

  void take_timed(const NmeaSentence& sentence, std::optional<Stamp> arrival);
  void take_untimed(const NmeaSentence& sentence, std::optional<Stamp> arrival);
  void open(std::optional<Stamp> time, std::optional<Stamp> arrival);
  void close();
  void put(const NmeaSentence& sentence, bool is_timed);
  void give_out();
  void give_out_satellites();
  void end_early_if_learnt(std::optional<Stamp> arrival);
  void learn_end();
  std::optional<Stamp> stamp_of(const Solution& solution);
  bool follows_a_pause(std::optional<Stamp> arrival) const;
  void warn_once(const std::string& warning);

  NmeaParameters parameters_;
  NmeaClock clock_;
  NmeaCounts counts_;
  ReceiverOutput output_;
  std::optional<Solution> open_;
  std::vector<NmeaSentence> ahead_;    ///< without a time, of the solution that begins
  std::optional<Stamp> closed_time_;   ///< of day, of the solution before
  std::optional<Stamp> last_arrival_;  ///< of any sentence that is used
  std::optional<Stamp> interval_;      ///< between the last two solutions
  std::optional<Stamp> last_stamp_;    ///< that was given out
  std::string end_key_;                ///< of the sentence that ended the last solution
  int end_count_{0};                   ///< the how-many-eth of its key
  int ends_in_a_row_{0};
  int distrust_{0};  ///< solutions for which no end is believed
  std::set<std::string> said_;
};

}  // namespace urban_gnss
