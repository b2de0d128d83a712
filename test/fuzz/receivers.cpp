// What receivers and their drivers say: NMEA, gpsd, and ROS messages by the definition that comes with them.

#include <cmath>
#include <cstring>

#include "driver_messages.hpp"
#include "receiver_soundness.hpp"
#include "target.hpp"
#include "urban_gnss_localization/receivers/gpsd_decoder.hpp"
#include "urban_gnss_localization/receivers/nmea_decoder.hpp"

namespace urban_gnss::fuzz {
namespace {

void require_sound(const ReceiverOutput& output) {
  const std::string fault = fault_of(output);
  require(fault.empty(), fault);
}

/// Reads every field as what it is, and those of the messages within.
void walk(const MessageView& view, const MessageDefinition& definition, const MessageDefinition::Type& type,
          const std::string& prefix, int depth) {
  constexpr std::size_t kMostItems = 8;
  for (const MessageDefinition::Field& field : type.fields) {
    const std::string path = prefix + field.name;
    require(view.has(path), "no field " + path);
    const bool is_array = field.length != MessageDefinition::kNoArray;
    if (field.kind == FieldKind::kMessage && is_array) {
      std::vector<MessageView> items = view.items(path);
      if (depth > 3) continue;
      for (std::size_t i = 0; i < std::min(items.size(), kMostItems); ++i) {
        walk(items[i], definition, definition.at(field.type), "", depth + 1);
      }
    } else if (field.kind == FieldKind::kMessage) {
      if (depth <= 3) walk(view, definition, definition.at(field.type), path + ".", depth + 1);
    } else if (is_array) {
      if (field.kind <= FieldKind::kFloat64) view.numbers(path);
    } else if (field.kind == FieldKind::kString) {
      view.text(path);
    } else if (field.kind == FieldKind::kTime || field.kind == FieldKind::kDuration) {
      view.stamp(path);
    } else {
      view.number(path);
      if (field.kind <= FieldKind::kUint64) view.integer(path);
    }
  }
}

/// Takes `count` bytes from the front, or what there is.
std::string take(std::string& bytes, std::size_t count) {
  const std::string taken = bytes.substr(0, count);
  bytes.erase(0, taken.size());
  return taken;
}

std::size_t take_number(std::string& bytes) {
  std::uint16_t number = 0;
  const std::string taken = take(bytes, sizeof(number));
  std::memcpy(&number, taken.data(), taken.size());
  return number;
}

}  // namespace

void read_nmea(const std::string& bytes) {
  NmeaDecoder by_time(NmeaParameters(), NmeaClock::near(Stamp(std::chrono::hours(24 * 18299 + 12))));
  NmeaDecoder by_arrival;
  NmeaDecoder by_date;
  Stamp arrival{0};
  for (const std::string_view line : split_nmea_lines(bytes)) {
    by_time.add(line);
    by_date.add(line);
    arrival += Stamp(7'000'000);
    by_arrival.add(line, arrival);
  }
  for (NmeaDecoder* decoder : {&by_time, &by_arrival, &by_date}) {
    decoder->finish();
    require_sound(decoder->take());
  }
}

void read_gpsd(const std::string& bytes) {
  GpsdDecoder by_arrival;
  GpsdParameters of_utc;
  of_utc.stamps = GpsdStamps::kUtc;
  of_utc.accept_simulated = true;
  GpsdDecoder by_time(of_utc);
  Stamp arrival{0};
  for (std::size_t begin = 0; begin < bytes.size();) {
    const std::size_t end = std::min(bytes.find('\n', begin), bytes.size());
    const std::string_view line = std::string_view(bytes).substr(begin, end - begin);
    begin = end + 1;
    by_arrival.add(line, arrival += Stamp(50'000'000));
    by_time.add(line);
  }
  for (GpsdDecoder* decoder : {&by_arrival, &by_time}) {
    decoder->settle();
    require_sound(decoder->take());
  }
}

/// A definition, a zero, a message.
void read_definition(const std::string& bytes) {
  const std::size_t zero = std::min(bytes.find('\0'), bytes.size());
  const std::string message = zero < bytes.size() ? bytes.substr(zero + 1) : "";
  try {
    const MessageDefinition definition("fuzz_msgs/Message", "0123456789abcdef", bytes.substr(0, zero));
    const MessageView view(definition, reinterpret_cast<const std::uint8_t*>(message.data()), message.size());
    walk(view, definition, definition.root(), "", 0);
  } catch (const MessageError& error) {
    const std::string text = error.what();
    require(text.find("fuzz_msgs/Message") != std::string::npos, "a refusal without the type: " + text);
  }
}

/// A driver, then messages: the topic, how many bytes (two of them), the bytes.
void read_receiver(const std::string& bytes) {
  using namespace driver;
  static const std::vector<Connection> kConnections = {kNavPvt,    kNavSat, kNavSvinfo, kNavSatFix, kTwist,
                                                       kGpsStatus, kGpsFix, kTrackstat, kGpgsv,     kSentence};
  std::string rest = bytes;
  if (rest.empty()) return;
  const auto number_of = [&rest] { return static_cast<std::size_t>(static_cast<unsigned char>(take(rest, 1)[0])); };
  const std::vector<ReceiverPreset>& presets = receiver_presets();
  const ReceiverPreset& preset = presets[number_of() % (presets.size() - 1)];  // the last has no decoder
  ReceiverInput input(preset);
  Stamp arrival = Stamp(kSecond * 1000000000LL);
  while (!rest.empty()) {
    const ReceiverTopic& topic = preset.topics[number_of() % preset.topics.size()];
    const std::string message = take(rest, take_number(rest));
    for (const Connection& connection : kConnections) {
      if (!is_type_of(topic, connection.type)) continue;
      const MessageConnection full{topic.name, connection.type, "md5of" + connection.type, connection.definition};
      input.add(topic, full, reinterpret_cast<const std::uint8_t*>(message.data()), message.size(), arrival);
      break;
    }
    arrival += Stamp(100'000'000);
  }
  input.finish();
  const std::string fault = fault_of_numbers(input.take());
  require(fault.empty(), fault);
}

}  // namespace urban_gnss::fuzz
