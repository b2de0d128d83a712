#pragma once

#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

namespace urban_gnss {

/// Writes a ROS 1 message field by field, as a driver serialises it.
class MessageBytes {
 public:
  template <class T>
  MessageBytes& put(T value) {
    const auto* begin = reinterpret_cast<const std::uint8_t*>(&value);
    bytes_.insert(bytes_.end(), begin, begin + sizeof(T));
    return *this;
  }
  MessageBytes& text(const std::string& value) {
    put(static_cast<std::uint32_t>(value.size()));
    bytes_.insert(bytes_.end(), value.begin(), value.end());
    return *this;
  }
  template <class T>
  MessageBytes& array(const std::vector<T>& values) {
    put(static_cast<std::uint32_t>(values.size()));
    for (const T& value : values) put(value);
    return *this;
  }
  MessageBytes& zeros(std::size_t count) {
    bytes_.resize(bytes_.size() + count, 0);
    return *this;
  }
  /// std_msgs/Header.
  MessageBytes& header(std::uint32_t secs, std::uint32_t nsecs, const std::string& frame = "gps") {
    return put(std::uint32_t{7}).put(secs).put(nsecs).text(frame);
  }
  const std::vector<std::uint8_t>& bytes() const { return bytes_; }

 private:
  std::vector<std::uint8_t> bytes_;
};

inline const std::string kHeaderDefinition =
    "\n================================================================================\n"
    "MSG: std_msgs/Header\n"
    "# Standard metadata\nuint32 seq\n#Two-integer timestamp\ntime stamp\n#Frame\nstring frame_id\n";

}  // namespace urban_gnss
