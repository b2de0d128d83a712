#pragma once

#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace urban_gnss {

/// A ROS 1 message that cannot be read: its definition is malformed, its data do not fit it, or a field is missing.
/// what() names the type and its md5.
class MessageError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// What a field of a ROS 1 message holds.
enum class FieldKind : std::uint8_t {
  kBool,
  kInt8,
  kUint8,
  kInt16,
  kUint16,
  kInt32,
  kUint32,
  kInt64,
  kUint64,
  kFloat32,
  kFloat64,
  kTime,      ///< uint32 seconds, uint32 nanoseconds
  kDuration,  ///< int32 seconds, int32 nanoseconds
  kString,
  kMessage,
};

/// The type of a ROS 1 message, of the definition that travels with every connection and every bag: the text of the
/// .msg file, and behind lines of `=` and `MSG: package/Type` those of the messages within. Constants and comments are
/// left out. http://wiki.ros.org/msg, http://wiki.ros.org/ROS/Connection%20Header
class MessageDefinition {
 public:
  static constexpr std::uint32_t kNoArray = 0xFFFFFFFF;
  static constexpr std::uint32_t kVariableArray = 0xFFFFFFFE;

  struct Field {
    std::string name;
    FieldKind kind{FieldKind::kBool};
    std::size_t type{0};             ///< index of the message within, of kMessage
    std::uint32_t length{kNoArray};  ///< of an array; kNoArray, kVariableArray
    std::size_t element_size{0};     ///< least bytes of one element
    bool has_fixed_size_element{true};
  };
  struct Type {
    std::string name;
    std::vector<Field> fields;
    std::size_t size{0};  ///< least bytes
    bool has_fixed_size{true};
  };

  /// `type`: package/Type, `md5`: as the connection has them, for errors. Throws MessageError where the text is no
  /// definition.
  MessageDefinition(std::string type, std::string md5, std::string_view text);

  const std::string& type() const { return type_; }
  const std::string& md5() const { return md5_; }
  /// "package/Type (md5 …)", for errors.
  std::string describe() const { return type_ + " (md5 " + md5_ + ")"; }

  const Type& root() const { return types_.front(); }
  const Type& at(std::size_t type) const { return types_[type]; }

 private:
  std::string type_;
  std::string md5_;
  std::vector<Type> types_;  ///< the message itself, then those within
};

}  // namespace urban_gnss
