#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <tuple>
#include <vector>

#include "bag_file.hpp"
#include "urban_gnss_localization/ros/topics.hpp"

namespace urban_gnss {

/// One recording, in one or several bags.
class BagReader {
 public:
  /// Throws BagError where one of them cannot be read.
  explicit BagReader(const std::vector<std::string>& paths);
  explicit BagReader(const std::string& path) : BagReader(std::vector<std::string>{path}) {}

  /// "drive.bag", or "drive_0.bag and 2 more".
  std::string name() const;
  const std::vector<std::unique_ptr<BagFile>>& files() const { return files_; }
  /// Each once, in the order of their topics.
  std::vector<BagConnection> connections() const;
  /// How many messages a topic has, whose name may lack its leading slash.
  std::size_t count(const std::string& topic) const;
  /// What the bags have, one topic with its type a line, each after a line break.
  std::string topics() const;

 private:
  std::vector<std::unique_ptr<BagFile>> files_;
};

/// The messages of some topics, one by one: by the time they were recorded, then by what they are (as in `names`,
/// without leading slashes), then as they lie in the files. Holds the messages of the chunks that overlap, no more.
class BagMessages {
 public:
  BagMessages(const BagReader& bag, std::vector<std::string> names);

  /// How many there are in all.
  std::size_t size() const { return size_; }
  /// Between which all of them lie, as far as the index tells. Require size() > 0.
  Stamp first_time() const { return chunks_.front().chunk->first; }
  Stamp last_time() const;
  /// The next, or nothing at the end. Throws BagError where the bag is damaged.
  const BagMessage* peek();
  std::optional<BagMessage> next();

 private:
  struct PlacedChunk {
    BagFile* file;
    const BagFile::Chunk* chunk;
  };
  struct Placed {
    std::size_t rank;
    std::size_t number;
    BagMessage message;

    auto key() const { return std::make_tuple(message.time(), rank, number); }
  };
  /// The messages of a chunk, in order, as far as they have not been taken.
  struct Loaded {
    std::vector<Placed> messages;
    std::size_t next{0};

    const Placed& front() const { return messages[next]; }
  };
  /// Whether `a` comes after `b`.
  struct IsLater {
    bool operator()(const Loaded& a, const Loaded& b) const { return a.front().key() > b.front().key(); }
  };

  void load(const PlacedChunk& placed);
  std::size_t rank_of(const std::string& topic) const;

  std::vector<std::string> names_;
  std::vector<PlacedChunk> chunks_;  ///< by their first messages' times
  std::size_t next_chunk_{0};
  std::size_t size_{0};
  std::size_t loaded_{0};
  std::vector<Loaded> chunks_at_hand_;  ///< a heap, the one with the next message in front
};

}  // namespace urban_gnss
