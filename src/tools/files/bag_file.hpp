#pragma once

#include <cstdint>
#include <fstream>
#include <map>
#include <memory>
#include <set>
#include <stdexcept>
#include <string>
#include <vector>

#include "bag_message.hpp"

namespace urban_gnss {

/// A bag that cannot be read. The message names the file, says what is wrong, and what to do.
class BagError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// A file of the format "ROSBAG V2.0" (wiki.ros.org/Bags/Format/2.0). rosbag's own library believes every length and
/// position in the file; this reader compares each with the file before it is used. It holds connections and the places
/// of chunks, and no message.
class BagFile {
 public:
  using ConnectionId = std::uint32_t;
  struct Chunk {
    std::uint64_t position{0};
    Stamp first{0};  ///< of its messages' times
    Stamp last{0};
    std::map<ConnectionId, std::uint32_t> counts;
  };

  /// Throws BagError where it is no bag, or one without an index, or damaged.
  explicit BagFile(const std::string& path);

  const std::string& path() const { return path_; }
  const std::map<ConnectionId, std::shared_ptr<const BagConnection>>& connections() const { return connections_; }
  const std::vector<Chunk>& chunks() const { return chunks_; }

  /// The messages of the wanted connections, as they lie in the chunk, whose bytes they share. Throws BagError where it
  /// is damaged.
  std::vector<BagMessage> read(const Chunk& chunk, const std::set<ConnectionId>& wanted);

 private:
  struct Record;

  void open();
  void read_index(std::uint64_t position, std::uint32_t connection_count, std::uint32_t chunk_count);
  void add_connection(const Record& record);
  void add_chunk(const Record& record, std::uint64_t end);
  Record read_record(std::uint64_t position, bool with_data);
  std::vector<std::uint8_t> read_bytes(std::uint64_t position, std::uint64_t size);
  void read_bytes(std::uint64_t position, std::uint64_t size, std::vector<std::uint8_t>& bytes);
  /// What a chunk holds, decompressed.
  std::shared_ptr<const std::vector<std::uint8_t>> read_chunk(std::uint64_t position);
  /// One that no message shares any more, or a new one.
  std::shared_ptr<std::vector<std::uint8_t>> free_buffer();
  [[noreturn]] void fail_as_damaged(const std::string& what) const;

  std::string path_;
  std::ifstream file_;
  std::uint64_t size_{0};
  std::map<ConnectionId, std::shared_ptr<const BagConnection>> connections_;
  std::vector<Chunk> chunks_;
  std::vector<std::shared_ptr<std::vector<std::uint8_t>>> buffers_;  ///< of chunks, used again and again
  std::vector<std::uint8_t> compressed_;
};

}  // namespace urban_gnss
