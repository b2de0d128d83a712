#include "urban_gnss_localization/receivers/message_definition.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <optional>
#include <utility>

namespace urban_gnss {
namespace {

constexpr std::size_t kMaxDepth = 32;       ///< of messages within messages
constexpr std::size_t kMaxSize = 1U << 28;  ///< bytes of a message without its variable parts
constexpr std::size_t kMaxText = 1U << 22;  ///< bytes of a definition

struct Primitive {
  std::string_view name;
  FieldKind kind;
  std::size_t size;
};

constexpr std::array<Primitive, 16> kPrimitives = {{
    {"bool", FieldKind::kBool, 1},
    {"int8", FieldKind::kInt8, 1},
    {"byte", FieldKind::kInt8, 1},
    {"uint8", FieldKind::kUint8, 1},
    {"char", FieldKind::kUint8, 1},
    {"int16", FieldKind::kInt16, 2},
    {"uint16", FieldKind::kUint16, 2},
    {"int32", FieldKind::kInt32, 4},
    {"uint32", FieldKind::kUint32, 4},
    {"int64", FieldKind::kInt64, 8},
    {"uint64", FieldKind::kUint64, 8},
    {"float32", FieldKind::kFloat32, 4},
    {"float64", FieldKind::kFloat64, 8},
    {"time", FieldKind::kTime, 8},
    {"duration", FieldKind::kDuration, 8},
    {"string", FieldKind::kString, 4},
}};

std::string_view trimmed(std::string_view text) {
  const auto is_space = [](char c) { return std::isspace(static_cast<unsigned char>(c)) != 0; };
  while (!text.empty() && is_space(text.front())) text.remove_prefix(1);
  while (!text.empty() && is_space(text.back())) text.remove_suffix(1);
  return text;
}

bool is_separator(std::string_view line) {
  return line.size() >= 3 && line.find_first_not_of('=') == std::string_view::npos;
}

bool is_name(std::string_view text) {
  return !text.empty() && std::isdigit(static_cast<unsigned char>(text.front())) == 0 &&
         std::all_of(text.begin(), text.end(),
                     [](char c) { return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_'; });
}

std::string package_of(const std::string& type) { return type.substr(0, type.find('/')); }

/// A field as the text has it.
struct RawField {
  std::string type;
  std::string name;
  std::uint32_t length{MessageDefinition::kNoArray};
};

struct RawType {
  std::string name;
  std::vector<RawField> fields;
};

class Parser {
 public:
  explicit Parser(std::string where) : where_(std::move(where)) {}

  std::vector<RawType> parse(const std::string& type, std::string_view text) const {
    if (text.size() > kMaxText) fail("is too long");
    std::vector<RawType> types = {{type, {}}};
    bool awaits_name = false;
    while (!text.empty()) {
      const std::size_t end = std::min(text.find('\n'), text.size());
      const std::string_view line = trimmed(text.substr(0, end));
      text.remove_prefix(std::min(end + 1, text.size()));
      if (is_separator(line)) {
        awaits_name = true;
      } else if (awaits_name && !line.empty()) {
        types.push_back({message_name(line), {}});
        awaits_name = false;
      } else if (auto field = parse_field(line)) {
        std::vector<RawField>& fields = types.back().fields;
        const auto is_same = [&](const RawField& other) { return other.name == field->name; };
        if (std::any_of(fields.begin(), fields.end(), is_same)) fail("has two fields " + field->name);
        fields.push_back(std::move(*field));
      }
    }
    return types;
  }

  [[noreturn]] void fail(const std::string& what) const { throw MessageError(where_ + ": its definition " + what); }

 private:
  std::string message_name(std::string_view line) const {
    constexpr std::string_view kPrefix = "MSG:";
    if (line.substr(0, kPrefix.size()) != kPrefix) fail("has \"" + shown(line) + "\" where \"MSG:\" must be");
    return std::string(trimmed(line.substr(kPrefix.size())));
  }

  /// Nothing where the line is empty, a comment or a constant.
  std::optional<RawField> parse_field(std::string_view whole) const {
    const std::string_view line = trimmed(whole.substr(0, whole.find('#')));
    if (line.empty() || line.find('=') != std::string_view::npos) return std::nullopt;
    const std::size_t gap = line.find_first_of(" \t");
    if (gap == std::string_view::npos) fail("has a line without a name: \"" + shown(whole) + "\"");
    RawField field;
    field.name = std::string(trimmed(line.substr(gap)));
    if (!is_name(field.name)) fail("has a line that is no field: \"" + shown(whole) + "\"");
    std::string_view type = line.substr(0, gap);
    const std::size_t bracket = type.find('[');
    if (bracket != std::string_view::npos) {
      field.length = parse_length(type.substr(bracket), whole);
      type = type.substr(0, bracket);
    }
    field.type = std::string(type);
    return field;
  }

  std::uint32_t parse_length(std::string_view brackets, std::string_view line) const {
    if (brackets == "[]") return MessageDefinition::kVariableArray;
    std::uint64_t length = 0;
    bool is_good = brackets.size() > 2 && brackets.size() < 12 && brackets.back() == ']';
    for (std::size_t i = 1; is_good && i + 1 < brackets.size(); ++i) {
      is_good = std::isdigit(static_cast<unsigned char>(brackets[i])) != 0;
      length = 10 * length + static_cast<std::uint64_t>(brackets[i] - '0');
    }
    if (!is_good || length > kMaxSize) fail("has no good length of an array: \"" + shown(line) + "\"");
    return static_cast<std::uint32_t>(length);
  }

  static std::string shown(std::string_view line) { return std::string(line.substr(0, 80)); }

  std::string where_;
};

/// Finds the types of the fields among those that were parsed, and computes sizes.
class Resolver {
 public:
  Resolver(const Parser& parser, const std::vector<RawType>& raw) : parser_(parser), raw_(raw) {
    types_.resize(raw.size());
    states_.resize(raw.size(), State::kNew);
  }

  std::vector<MessageDefinition::Type> resolve() {
    resolve_type(0, 0);
    return std::move(types_);
  }

 private:
  enum class State { kNew, kOpen, kDone };

  void resolve_type(std::size_t index, std::size_t depth) {
    const RawType& raw = raw_[index];
    if (states_[index] == State::kDone) return;
    if (states_[index] == State::kOpen) parser_.fail("has " + raw.name + " within itself");
    if (depth > kMaxDepth) parser_.fail("has messages within messages, more than " + std::to_string(kMaxDepth));
    states_[index] = State::kOpen;
    MessageDefinition::Type type;
    type.name = raw.name;
    for (const RawField& field : raw.fields) {
      type.fields.push_back(resolve_field(field, raw.name, depth));
      add_size(type.fields.back(), type);
    }
    types_[index] = std::move(type);
    states_[index] = State::kDone;
  }

  MessageDefinition::Field resolve_field(const RawField& raw, const std::string& owner, std::size_t depth) {
    MessageDefinition::Field field;
    field.name = raw.name;
    field.length = raw.length;
    const auto primitive = std::find_if(kPrimitives.begin(), kPrimitives.end(),
                                        [&](const Primitive& each) { return each.name == raw.type; });
    if (primitive != kPrimitives.end()) {
      field.kind = primitive->kind;
      field.element_size = primitive->size;
      field.has_fixed_size_element = primitive->kind != FieldKind::kString;
      return field;
    }
    field.kind = FieldKind::kMessage;
    field.type = find(raw.type, owner);
    resolve_type(field.type, depth + 1);
    field.element_size = types_[field.type].size;
    field.has_fixed_size_element = types_[field.type].has_fixed_size;
    if (field.length != MessageDefinition::kNoArray && field.element_size == 0) {
      parser_.fail("has an array of messages without fields: " + raw.name);
    }
    return field;
  }

  void add_size(const MessageDefinition::Field& field, MessageDefinition::Type& type) const {
    const bool is_variable = field.length == MessageDefinition::kVariableArray;
    const std::size_t count = field.length == MessageDefinition::kNoArray ? 1 : field.length;
    const std::size_t size = is_variable ? 4 : count * field.element_size;  // no factor is beyond kMaxSize
    type.size += size;
    if (size > kMaxSize || type.size > kMaxSize) parser_.fail("is of a message that is too large: " + field.name);
    type.has_fixed_size = type.has_fixed_size && !is_variable && field.has_fixed_size_element;
  }

  /// By the rules of ROS: `Header` is std_msgs/Header, a name without a package is of the package of its owner.
  std::size_t find(const std::string& name, const std::string& owner) const {
    const bool has_package = name.find('/') != std::string::npos;
    const std::string full = name == "Header" ? "std_msgs/Header" : has_package ? name : package_of(owner) + "/" + name;
    for (std::size_t i = 1; i < raw_.size(); ++i) {
      if (raw_[i].name == full) return i;
    }
    parser_.fail("lacks the type " + full + ", which " + owner + " has");
  }

  const Parser& parser_;
  const std::vector<RawType>& raw_;
  std::vector<MessageDefinition::Type> types_;
  std::vector<State> states_;
};

}  // namespace

MessageDefinition::MessageDefinition(std::string type, std::string md5, std::string_view text)
    : type_(std::move(type)), md5_(std::move(md5)) {
  const Parser parser(describe());
  const std::vector<RawType> raw = parser.parse(type_, text);
  types_ = Resolver(parser, raw).resolve();
}

}  // namespace urban_gnss
