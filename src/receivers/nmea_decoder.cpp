#include "urban_gnss_localization/receivers/nmea_decoder.hpp"

#include <algorithm>
#include <utility>

namespace urban_gnss {
namespace {

constexpr Stamp kDay = std::chrono::hours(24);
constexpr Stamp kSameTime = std::chrono::milliseconds(10);
constexpr Stamp kFrozenClock = std::chrono::seconds(1);  // a time that stands still for longer is of several solutions
constexpr Stamp kMostWithoutFix = std::chrono::minutes(1);
constexpr int kEndsToLearn = 3;
constexpr int kDistrust = 60;
constexpr std::size_t kMostAhead = 200;  // sentences

bool has_time(const NmeaSentence& sentence) {
  static const std::set<std::string> types{"GGA", "RMC", "GNS", "GLL", "GST", "GRS", "GBS"};
  return types.count(sentence.type) > 0;
}
bool has_no_time(const NmeaSentence& sentence) {
  return sentence.type == "GSA" || sentence.type == "GSV" || sentence.type == "VTG";
}

/// What a sentence is, for telling solutions apart: a GSV by its signal, a GSA by its system.
std::string key_of(const NmeaSentence& sentence) {
  std::string key = sentence.talker + sentence.type;
  if (sentence.type == "GSA") key += sentence.field(17);
  if (sentence.type == "GSV" && sentence.fields.size() > 3 && sentence.fields.size() % 4 != 3 &&
      sentence.fields.size() % 4 != 2) {
    key += sentence.field(sentence.fields.size() % 4 == 0 ? sentence.fields.size() - 1 : sentence.fields.size() - 2);
  }
  return key;
}

/// Whether nothing of its group is still to come.
bool ends_group(const NmeaSentence& sentence) {
  return sentence.type != "GSV" || sentence.field(0) == sentence.field(1);
}

/// From a to b, by the shorter way round the clock.
Stamp time_between(Stamp a, Stamp b) {
  const Stamp difference = (b - a) % kDay;
  if (difference > kDay / 2) return difference - kDay;
  return difference < -kDay / 2 ? difference + kDay : difference;
}
bool is_same(Stamp a, Stamp b) { return std::chrono::abs(time_between(a, b)) <= kSameTime; }

}  // namespace

NmeaDecoder::NmeaDecoder(const NmeaParameters& parameters, const NmeaClock& clock)
    : parameters_(parameters), clock_(clock) {}

void NmeaDecoder::add(std::string_view line, std::optional<Stamp> arrival) {
  const NmeaParsing parsing = parse_nmea_sentence(line);
  if (!parsing.sentence) {
    ++counts_.refused[parsing.refusal];
    return;
  }
  const NmeaSentence& sentence = *parsing.sentence;
  ++counts_.sentences;
  const auto time = time_of_day(sentence);
  if (const auto day = day_of(sentence); day && time && sentence.field(1) != "V") clock_.set(*day, *time);
  if (has_time(sentence)) {
    take_timed(sentence, arrival);
  } else if (has_no_time(sentence)) {
    take_untimed(sentence, arrival);
  } else {
    return;
  }
  end_early_if_learnt(arrival);
  last_arrival_ = arrival;
}

ReceiverOutput NmeaDecoder::take() { return std::exchange(output_, {}); }

void NmeaDecoder::finish() {
  close();
  ahead_.clear();
}

void NmeaDecoder::take_timed(const NmeaSentence& sentence, std::optional<Stamp> arrival) {
  const auto time = time_of_day(sentence);
  if (time) {
    const bool is_of_open =
        open_ && (open_->time ? is_same(*open_->time, *time) : open_->seen.count(key_of(sentence)) == 0);
    const bool is_frozen = is_of_open && arrival && open_->arrival && *arrival - *open_->arrival > kFrozenClock &&
                           open_->seen.count(key_of(sentence)) > 0;
    if (!is_of_open || is_frozen) {
      if (!is_frozen && closed_time_ && is_same(*closed_time_, *time)) {
        ++counts_.late_sentences;
        return;
      }
      close();
      open(time, arrival);
    }
    if (!open_->time) open_->time = time;
  } else if (is_about_position(sentence)) {
    if (!open_ || open_->seen.count(key_of(sentence)) > 0) {
      close();
      open(std::nullopt, arrival);
    }
  } else if (!open_) {
    return;
  }
  if (!open_->arrival) open_->arrival = arrival;
  put(sentence, true);
}

void NmeaDecoder::take_untimed(const NmeaSentence& sentence, std::optional<Stamp> arrival) {
  const std::string key = key_of(sentence);
  const bool is_second = open_ && open_->seen.count(key) > 0 && open_->since_timed.count(key) == 0;
  if (open_ && (is_second || follows_a_pause(arrival))) close();
  if (open_) return put(sentence, false);
  if (ahead_.size() < kMostAhead) ahead_.push_back(sentence);
}

void NmeaDecoder::open(std::optional<Stamp> time, std::optional<Stamp> arrival) {
  open_ = Solution();  // Clang 14 refuses emplace() of a class within that has defaults
  open_->time = time;
  open_->arrival = arrival;
  for (const NmeaSentence& sentence : std::exchange(ahead_, {})) put(sentence, false);
}

void NmeaDecoder::put(const NmeaSentence& sentence, bool is_timed) {
  open_->content.add(sentence);
  if (sentence.type == "GSV") open_->sky.add_gsv(sentence);
  if (sentence.type == "GSA") open_->sky.add_gsa(sentence);
  if (sentence.type == "GRS") open_->sky.add_grs(sentence);
  const std::string key = key_of(sentence);
  if (is_timed) open_->since_timed.clear();
  if (!is_timed) open_->since_timed.insert(key);
  if (ends_group(sentence)) ++open_->seen[key];
  open_->last_key = key;
  if (open_->is_given_out) {
    distrust_ = kDistrust;
    if (!is_timed && open_->satellites_given_out) ++counts_.late_sentences;
  }
}

/// The open solution is complete.
void NmeaDecoder::close() {
  if (!open_) return;
  learn_end();
  give_out();
  give_out_satellites();
  if (closed_time_ && open_->time) {
    const Stamp interval = time_between(*closed_time_, *open_->time);
    if (interval > Stamp(0)) interval_ = interval;
  }
  closed_time_ = open_->time;
  open_.reset();
}

void NmeaDecoder::learn_end() {
  if (distrust_ > 0) --distrust_;
  const int count = open_->seen[open_->last_key];
  const bool is_the_same = open_->last_key == end_key_ && count == end_count_;
  ends_in_a_row_ = is_the_same ? ends_in_a_row_ + 1 : 1;
  end_key_ = open_->last_key;
  end_count_ = count;
}

void NmeaDecoder::end_early_if_learnt(std::optional<Stamp> arrival) {
  if (!arrival || !open_ || open_->is_given_out || distrust_ > 0 || ends_in_a_row_ < kEndsToLearn) return;
  const auto seen = open_->seen.find(end_key_);
  if (open_->last_key != end_key_ || seen == open_->seen.end() || seen->second != end_count_) return;
  give_out();
  give_out_satellites();
}

bool NmeaDecoder::follows_a_pause(std::optional<Stamp> arrival) const {
  constexpr double kPause = 0.3;
  if (!arrival || !last_arrival_ || !interval_) return false;
  return to_seconds(*arrival - *last_arrival_) > kPause * to_seconds(*interval_);
}

/// Nothing where none can be told.
std::optional<Stamp> NmeaDecoder::stamp_of(const Solution& solution) {
  if (solution.arrival) return solution.arrival;
  if (!solution.time) return std::nullopt;
  if (solution.content.has_fix(parameters_)) return clock_.advance(*solution.time);
  const auto stamp = clock_.utc(*solution.time);
  const bool follows = stamp && last_stamp_ && *stamp > *last_stamp_ && *stamp - *last_stamp_ <= kMostWithoutFix;
  return follows ? clock_.advance(*solution.time) : std::nullopt;
}

/// Fix and velocity of the open solution.
void NmeaDecoder::give_out() {
  if (open_->is_given_out || !open_->content.has_status()) return;
  open_->is_given_out = true;
  open_->stamp = stamp_of(*open_);
  if (!open_->stamp) {
    ++counts_.without_time;
    return;
  }
  ++counts_.solutions;
  last_stamp_ = open_->stamp;
  const NmeaSolution& content = open_->content;
  output_.fixes.push_back(content.fix(*open_->stamp, parameters_));
  if (const auto velocity = content.velocity(*open_->stamp, parameters_)) output_.velocities.push_back(*velocity);
  if (content.lacks_geoid()) {
    warn_once("GGA: no height of the geoid (field 11): altitudes are above sea level, not above the ellipsoid");
  }
  if (content.is_reckoned()) {
    warn_once("the receiver reckons its position without satellites (GGA quality 6, mode E): taken as no fix");
  }
  if (content.is_told()) warn_once("the receiver was told its position (GGA quality 7, mode M): taken as no fix");
  if (content.is_simulated() && !parameters_.accept_simulated) {
    warn_once("the receiver simulates (GGA quality 8, mode S): taken as no fix; accept_simulated takes it");
  }
}

void NmeaDecoder::give_out_satellites() {
  const NmeaSky& sky = open_->sky;
  if (!open_->stamp || open_->satellites_given_out || !sky.has_gsv()) return;
  open_->satellites_given_out = true;
  output_.satellites.push_back({*open_->stamp, sky.satellites(), sky.angle_resolution_rad()});
  if (sky.unknown_numbers() > 0) warn_once("GSV: satellites with numbers that no system has are left out");
}

void NmeaDecoder::warn_once(const std::string& warning) {
  if (said_.insert(warning).second) output_.warnings.push_back(warning);
}

}  // namespace urban_gnss
