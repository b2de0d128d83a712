#pragma once

#include <ros/message_traits.h>
#include <ros/serialization.h>
#include <ros/time.h>

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <map>
#include <string>
#include <vector>

#include "input_files.hpp"
#include "urban_gnss_localization/common/pending_file.hpp"

namespace urban_gnss {

/// A bag that is written, of the format "ROSBAG V2.0" (wiki.ros.org/Bags/Format/2.0), not compressed. It appears whole,
/// by close(), or not at all. rosbag's own library reads from the file and seeks at each message, which takes longer
/// than a localizer's step; here a chunk is written at once.
class OutputBag {
 public:
  /// Throws std::runtime_error that names the file where it is one of `inputs` or cannot be written.
  OutputBag(const std::filesystem::path& path, const InputFiles& inputs);

  /// Throws std::runtime_error that names the file where the disk does not take it, or the time is below ros::TIME_MIN.
  template <class Message>
  void write(const std::string& topic, const ros::Time& time, const Message& message) {
    namespace traits = ros::message_traits;
    auto known = connections_.find(topic);
    if (known == connections_.end()) {
      known = add_connection(topic, traits::datatype(message), traits::md5sum(message), traits::definition(message));
    }
    const std::uint32_t size = ros::serialization::serializationLength(message);
    ros::serialization::OStream stream(begin_message(known->second, time, size), size);
    ros::serialization::serialize(stream, message);
    if (chunk_.size() >= kChunkSize) end_chunk();
  }
  void close();
  /// Bytes so far.
  std::uint64_t size() const { return position_ + chunk_.size(); }

 private:
  static constexpr std::size_t kChunkSize = 768 * 1024;  ///< bytes, as rosbag's
  struct Connection {
    std::uint32_t id{0};
    std::string record;
    std::string message_header;  ///< of every message, which ends with its time
  };
  struct Entry {
    ros::Time time;
    std::uint32_t offset;  ///< bytes into the chunk
  };
  using Connections = std::map<std::string, Connection>;

  Connections::iterator add_connection(const std::string& topic, const std::string& type, const std::string& md5sum,
                                       const std::string& definition);
  /// Where `size` bytes of the message go.
  std::uint8_t* begin_message(const Connection& connection, const ros::Time& time, std::uint32_t size);
  void end_chunk();
  void write_file_header(std::uint64_t index_position);
  void put(const std::string& bytes);

  PendingFile pending_;
  std::ofstream file_;
  std::uint64_t position_{0};                            ///< bytes written
  Connections connections_;                              ///< by topic
  std::string chunk_;                                    ///< the records of the one that is open
  std::map<std::uint32_t, std::vector<Entry>> entries_;  ///< of its messages, by connection
  std::string chunk_infos_;                              ///< the records of those that are written
  std::uint32_t chunk_count_{0};
};

}  // namespace urban_gnss
