#pragma once

#include <ros/message_traits.h>
#include <ros/serialization.h>

#include <boost/make_shared.hpp>
#include <boost/shared_ptr.hpp>
#include <cstdint>
#include <cstring>
#include <memory>
#include <stdexcept>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "urban_gnss_localization/common/stamp.hpp"

namespace urban_gnss {

/// Who published what, as a bag has it.
struct BagConnection {
  std::string bag;  ///< the file
  std::string topic, type, md5sum, definition;
};

/// As ros::serialization::IStream, but the length of an array is compared with what follows before room is made for it.
class CheckedStream {
 public:
  static constexpr ros::serialization::StreamType stream_type = ros::serialization::stream_types::Input;

  CheckedStream(const std::uint8_t* begin, const std::uint8_t* end) : next_(begin), end_(end) {}

  template <class T>
  void next(T& value) {
    ros::serialization::deserialize(*this, value);
  }
  template <class T, class Allocator>
  void next(std::vector<T, Allocator>& array) {
    constexpr std::size_t kSmallest = std::is_arithmetic_v<T> ? sizeof(T) : 1;
    std::uint32_t count = 0;
    if (length() >= sizeof(count)) std::memcpy(&count, next_, sizeof(count));
    if (count > length() / kSmallest) throw ros::serialization::StreamOverrunException("an array is too long");
    ros::serialization::deserialize(*this, array);
  }
  std::uint8_t* advance(std::uint32_t size) {
    if (size > length()) throw ros::serialization::StreamOverrunException("it is too short");
    const std::uint8_t* const here = next_;
    next_ += size;
    return const_cast<std::uint8_t*>(here);
  }
  std::uint8_t* getData() { return const_cast<std::uint8_t*>(next_); }
  std::uint32_t getLength() const { return static_cast<std::uint32_t>(length()); }

 private:
  std::size_t length() const { return static_cast<std::size_t>(end_ - next_); }

  const std::uint8_t* next_;
  const std::uint8_t* end_;
};

/// A message of a bag, with the names that rosbag::MessageInstance has.
class BagMessage {
 public:
  /// `bytes` lie in the chunk.
  BagMessage(std::shared_ptr<const BagConnection> connection, Stamp time,
             std::shared_ptr<const std::vector<std::uint8_t>> chunk, std::string_view bytes)
      : connection_(std::move(connection)), time_(time), chunk_(std::move(chunk)), bytes_(bytes) {}

  const BagConnection& connection() const { return *connection_; }
  /// The file that it is in.
  const std::string& bag() const { return connection_->bag; }
  /// When it was recorded.
  Stamp time() const { return time_; }
  const std::string& getTopic() const { return connection_->topic; }
  const std::string& getDataType() const { return connection_->type; }
  const std::string& getMD5Sum() const { return connection_->md5sum; }
  const std::string& getMessageDefinition() const { return connection_->definition; }
  std::uint32_t size() const { return static_cast<std::uint32_t>(bytes_.size()); }

  template <class Stream>
  void write(Stream& stream) const {
    if (!bytes_.empty()) std::memcpy(stream.advance(size()), bytes_.data(), bytes_.size());
  }

  /// The message as an M; null where it is of another type. Throws std::runtime_error that names the topic where it is
  /// of another version of M, or damaged.
  template <class M>
  boost::shared_ptr<M> instantiate() const {
    namespace traits = ros::message_traits;
    if (getDataType() != traits::DataType<M>::value()) return nullptr;
    const auto where = [this] { return bag() + ": " + getTopic() + ": "; };
    if (getMD5Sum() != traits::MD5Sum<M>::value()) {
      throw std::runtime_error(where() + "its " + getDataType() + " is of another version, or the bag is damaged");
    }
    auto message = boost::make_shared<M>();
    try {
      const auto* const begin = reinterpret_cast<const std::uint8_t*>(bytes_.data());
      CheckedStream stream(begin, begin + bytes_.size());
      stream.next(*message);
    } catch (const ros::serialization::StreamOverrunException&) {
      throw std::runtime_error(where() + "a " + getDataType() + " is damaged: it is shorter than it says");
    }
    return message;
  }

 private:
  std::shared_ptr<const BagConnection> connection_;
  Stamp time_;
  std::shared_ptr<const std::vector<std::uint8_t>> chunk_;  ///< that holds the bytes
  std::string_view bytes_;
};

inline std::runtime_error wrong_type(const BagMessage& message, const std::string& expected) {
  return std::runtime_error(message.bag() + ": " + message.getTopic() + ": is " + message.getDataType() + ", must be " +
                            expected);
}

/// The message as an M. Throws std::runtime_error that names bag and topic where it is of another type, or damaged.
template <class M>
boost::shared_ptr<M> expect(const BagMessage& message) {
  const auto typed = message.instantiate<M>();
  if (!typed) throw wrong_type(message, ros::message_traits::DataType<M>::value());
  return typed;
}

}  // namespace urban_gnss
