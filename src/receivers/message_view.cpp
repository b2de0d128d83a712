#include "urban_gnss_localization/receivers/message_view.hpp"

#include <cstring>
#include <utility>

namespace urban_gnss {
namespace {

using Field = MessageDefinition::Field;
using Type = MessageDefinition::Type;

bool is_number(FieldKind kind) { return kind <= FieldKind::kFloat64; }
bool is_integer(FieldKind kind) { return kind <= FieldKind::kUint64; }
bool is_time(FieldKind kind) { return kind == FieldKind::kTime || kind == FieldKind::kDuration; }
bool is_text(FieldKind kind) { return kind == FieldKind::kString; }

/// ROS messages are little-endian, as are the machines that ROS 1 runs on.
template <class T>
T load(const std::uint8_t* bytes) {
  T value;
  std::memcpy(&value, bytes, sizeof(T));
  return value;
}

std::int64_t load_integer(FieldKind kind, const std::uint8_t* bytes) {
  switch (kind) {
    case FieldKind::kBool: return *bytes != 0 ? 1 : 0;
    case FieldKind::kInt8: return load<std::int8_t>(bytes);
    case FieldKind::kUint8: return load<std::uint8_t>(bytes);
    case FieldKind::kInt16: return load<std::int16_t>(bytes);
    case FieldKind::kUint16: return load<std::uint16_t>(bytes);
    case FieldKind::kInt32: return load<std::int32_t>(bytes);
    case FieldKind::kUint32: return load<std::uint32_t>(bytes);
    case FieldKind::kUint64: return static_cast<std::int64_t>(load<std::uint64_t>(bytes));
    default: return load<std::int64_t>(bytes);
  }
}

double load_number(FieldKind kind, const std::uint8_t* bytes) {
  switch (kind) {
    case FieldKind::kFloat32: return load<float>(bytes);
    case FieldKind::kFloat64: return load<double>(bytes);
    case FieldKind::kUint64: return static_cast<double>(load<std::uint64_t>(bytes));
    default: return static_cast<double>(load_integer(kind, bytes));
  }
}

}  // namespace

MessageView::MessageView(const MessageDefinition& definition, const std::uint8_t* data, std::size_t size)
    : definition_(&definition), type_(&definition.root()), data_(data), size_(size) {
  const std::size_t end = after(*type_, 0);
  if (end != size) {
    throw MessageError(definition.describe() + ": has " + std::to_string(size) + " bytes, " +
                       std::to_string(size - end) + " more than its definition says");
  }
}

MessageView::MessageView(const MessageView& whole, const Type& type, std::size_t offset, std::string prefix)
    : definition_(whole.definition_),
      type_(&type),
      data_(whole.data_),
      size_(whole.size_),
      start_(offset),
      prefix_(std::move(prefix)) {}

const std::uint8_t* MessageView::at(std::size_t offset, std::size_t size) const {
  if (offset > size_ || size > size_ - offset) {
    throw MessageError(definition_->describe() + ": is cut off: has " + std::to_string(size_) +
                       " bytes, fewer than its definition and the lengths in it say");
  }
  return data_ + offset;
}

std::uint32_t MessageView::length_at(std::size_t offset) const { return load<std::uint32_t>(at(offset, 4)); }

MessageView::Array MessageView::array_at(const Field& field, std::size_t offset) const {
  Array array{field.length, offset};
  if (field.length == MessageDefinition::kVariableArray) array = {length_at(offset), offset + 4};
  at(array.offset, array.count * field.element_size);  // no element is empty, and no factor is beyond 2^32
  return array;
}

std::size_t MessageView::after(const Type& type, std::size_t offset) const {
  if (type.has_fixed_size) {
    at(offset, type.size);
    return offset + type.size;
  }
  for (const Field& field : type.fields) offset = after(field, offset);
  return offset;
}

std::size_t MessageView::after(const Field& field, std::size_t offset) const {
  if (field.length == MessageDefinition::kNoArray) return after_element(field, offset);
  const Array array = array_at(field, offset);
  if (field.has_fixed_size_element) return array.offset + array.count * field.element_size;
  offset = array.offset;
  for (std::size_t i = 0; i < array.count; ++i) offset = after_element(field, offset);
  return offset;
}

std::size_t MessageView::after_element(const Field& field, std::size_t offset) const {
  if (field.kind == FieldKind::kMessage) return after(definition_->at(field.type), offset);
  const std::size_t size = field.kind == FieldKind::kString ? std::size_t{4} + length_at(offset) : field.element_size;
  at(offset, size);
  return offset + size;
}

std::optional<MessageView::Found> MessageView::find(std::string_view path) const {
  const Type* type = type_;
  std::size_t offset = start_;
  while (true) {
    const std::size_t dot = path.find('.');
    const std::string_view name = path.substr(0, dot);
    const Field* found = nullptr;
    for (const Field& field : type->fields) {
      if (field.name == name) {
        found = &field;
        break;
      }
      offset = after(field, offset);
    }
    if (found == nullptr) return std::nullopt;
    if (dot == std::string_view::npos) return Found{found, offset};
    if (found->kind != FieldKind::kMessage || found->length != MessageDefinition::kNoArray) return std::nullopt;
    type = &definition_->at(found->type);
    path.remove_prefix(dot + 1);
  }
}

bool MessageView::has_text(std::string_view path) const {
  const auto found = find(path);
  return found && found->field->length == MessageDefinition::kNoArray && is_text(found->field->kind);
}

MessageView::Found MessageView::require(std::string_view path) const {
  const auto found = find(path);
  if (!found) throw MessageError(definition_->describe() + ": has no field " + prefix_ + std::string(path));
  return *found;
}

MessageView::Found MessageView::require_single(std::string_view path, bool (*is_good)(FieldKind),
                                               const char* what) const {
  const Found found = require(path);
  if (found.field->length != MessageDefinition::kNoArray || !is_good(found.field->kind)) fail(path, what);
  return found;
}

void MessageView::fail(std::string_view path, const std::string& what) const {
  throw MessageError(definition_->describe() + ": its field " + prefix_ + std::string(path) + " is no " + what);
}

double MessageView::number(std::string_view path) const {
  const Found found = require_single(path, is_number, "number");
  return load_number(found.field->kind, at(found.offset, found.field->element_size));
}

std::int64_t MessageView::integer(std::string_view path) const {
  const Found found = require_single(path, is_integer, "integer");
  return load_integer(found.field->kind, at(found.offset, found.field->element_size));
}

std::string MessageView::text(std::string_view path) const {
  const Found found = require_single(path, is_text, "string");
  const std::uint32_t length = length_at(found.offset);
  return std::string(reinterpret_cast<const char*>(at(found.offset + 4, length)), length);
}

Stamp MessageView::stamp(std::string_view path) const {
  const Found found = require_single(path, is_time, "time");
  const std::uint8_t* bytes = at(found.offset, 8);
  constexpr std::int64_t kSecond_ns = 1000000000;
  if (found.field->kind == FieldKind::kDuration) {
    return Stamp(load<std::int32_t>(bytes) * kSecond_ns + load<std::int32_t>(bytes + 4));
  }
  return Stamp(load<std::uint32_t>(bytes) * kSecond_ns + load<std::uint32_t>(bytes + 4));
}

std::vector<double> MessageView::numbers(std::string_view path) const {
  const Found found = require(path);
  if (found.field->length == MessageDefinition::kNoArray || !is_number(found.field->kind)) {
    fail(path, "array of numbers");
  }
  const Array array = array_at(*found.field, found.offset);
  const std::uint8_t* bytes = at(array.offset, array.count * found.field->element_size);
  std::vector<double> values;
  values.reserve(array.count);
  for (std::size_t i = 0; i < array.count; ++i) {
    values.push_back(load_number(found.field->kind, bytes + i * found.field->element_size));
  }
  return values;
}

std::vector<MessageView> MessageView::items(std::string_view path) const {
  const Found found = require(path);
  if (found.field->length == MessageDefinition::kNoArray || found.field->kind != FieldKind::kMessage) {
    fail(path, "array of messages");
  }
  const Array array = array_at(*found.field, found.offset);
  std::vector<MessageView> views;
  std::size_t offset = array.offset;
  for (std::size_t i = 0; i < array.count; ++i) {
    views.push_back(
        MessageView(*this, definition_->at(found.field->type), offset, prefix_ + std::string(path) + "[]."));
    offset = after_element(*found.field, offset);
  }
  return views;
}

}  // namespace urban_gnss
