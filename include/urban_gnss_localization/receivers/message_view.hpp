#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "urban_gnss_localization/common/stamp.hpp"
#include "urban_gnss_localization/receivers/message_definition.hpp"

namespace urban_gnss {

/// The bytes of a ROS 1 message, or of a message within it, read by its definition. A field is named by its path, as
/// "header.stamp" or "twist.twist.linear.x". Whoever asks for a field that is not there, or as something that it is
/// not, gets a MessageError that names type, md5 and field. The bytes were all checked to be there when the view was
/// made, so that no length in them is trusted. Refers to definition and bytes, which must live on.
class MessageView {
 public:
  /// Throws MessageError where the data are shorter or longer than the definition says.
  MessageView(const MessageDefinition& definition, const std::uint8_t* data, std::size_t size);

  bool has(std::string_view path) const { return find(path).has_value(); }
  bool has_text(std::string_view path) const;
  /// A number of any type, or a bool.
  double number(std::string_view path) const;
  /// Requires that the field is no floating-point number.
  std::int64_t integer(std::string_view path) const;
  std::string text(std::string_view path) const;
  /// A time or a duration.
  Stamp stamp(std::string_view path) const;
  /// An array of numbers.
  std::vector<double> numbers(std::string_view path) const;
  /// An array of messages.
  std::vector<MessageView> items(std::string_view path) const;

  /// The number, or `otherwise` where there is no such field.
  double number_or(std::string_view path, double otherwise) const { return has(path) ? number(path) : otherwise; }
  std::vector<double> numbers_if_any(std::string_view path) const {
    return has(path) ? numbers(path) : std::vector<double>();
  }

  const MessageDefinition& definition() const { return *definition_; }

 private:
  struct Found {
    const MessageDefinition::Field* field;
    std::size_t offset;  ///< of its first byte
  };
  struct Array {
    std::size_t count;
    std::size_t offset;  ///< of the first element
  };

  MessageView(const MessageView& whole, const MessageDefinition::Type& type, std::size_t offset, std::string prefix);

  const std::uint8_t* at(std::size_t offset, std::size_t size) const;
  std::uint32_t length_at(std::size_t offset) const;
  Array array_at(const MessageDefinition::Field& field, std::size_t offset) const;
  std::size_t after(const MessageDefinition::Type& type, std::size_t offset) const;
  std::size_t after(const MessageDefinition::Field& field, std::size_t offset) const;
  std::size_t after_element(const MessageDefinition::Field& field, std::size_t offset) const;

  std::optional<Found> find(std::string_view path) const;
  Found require(std::string_view path) const;
  /// Throws where the field is an array, or none of `what`.
  Found require_single(std::string_view path, bool (*is_good)(FieldKind), const char* what) const;
  [[noreturn]] void fail(std::string_view path, const std::string& what) const;

  const MessageDefinition* definition_;
  const MessageDefinition::Type* type_;
  const std::uint8_t* data_;
  std::size_t size_;
  std::size_t start_{0};
  std::string prefix_;  ///< of the paths, for errors
};

}  // namespace urban_gnss
