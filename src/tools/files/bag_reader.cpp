#include "bag_reader.hpp"

#include <algorithm>
#include <map>
#include <set>
#include <tuple>
#include <utility>

namespace urban_gnss {

BagReader::BagReader(const std::vector<std::string>& paths) {
  for (const std::string& path : paths) files_.push_back(std::make_unique<BagFile>(path));
}

std::string BagReader::name() const {
  if (files_.empty()) return "no bag";
  const std::string& first = files_.front()->path();
  return files_.size() == 1 ? first : first + " and " + std::to_string(files_.size() - 1) + " more";
}

std::vector<BagConnection> BagReader::connections() const {
  std::vector<BagConnection> all;
  for (const auto& file : files_) {
    for (const auto& [id, connection] : file->connections()) all.push_back(*connection);
  }
  const auto key = [](const BagConnection& each) { return std::tie(each.topic, each.type); };
  std::stable_sort(all.begin(), all.end(), [&](const auto& a, const auto& b) { return key(a) < key(b); });
  all.erase(std::unique(all.begin(), all.end(), [&](const auto& a, const auto& b) { return key(a) == key(b); }),
            all.end());
  return all;
}

std::size_t BagReader::count(const std::string& topic) const {
  std::size_t count = 0;
  for (const auto& file : files_) {
    for (const BagFile::Chunk& chunk : file->chunks()) {
      for (const auto& [id, messages] : chunk.counts) {
        const std::string& name = file->connections().at(id)->topic;
        if (without_leading_slash(name) == without_leading_slash(topic)) count += messages;
      }
    }
  }
  return count;
}

std::string BagReader::topics() const {
  std::string text;
  for (const BagConnection& each : connections()) text += "\n  " + each.topic + " (" + each.type + ")";
  return text.empty() ? " none at all" : text;
}

BagMessages::BagMessages(const BagReader& bag, std::vector<std::string> names) : names_(std::move(names)) {
  for (const auto& file : bag.files()) {
    for (const BagFile::Chunk& chunk : file->chunks()) {
      std::size_t wanted = 0;
      for (const auto& [id, count] : chunk.counts) {
        if (rank_of(file->connections().at(id)->topic) < names_.size()) wanted += count;
      }
      if (wanted > 0) chunks_.push_back({file.get(), &chunk});
      size_ += wanted;
    }
  }
  std::stable_sort(chunks_.begin(), chunks_.end(),
                   [](const PlacedChunk& a, const PlacedChunk& b) { return a.chunk->first < b.chunk->first; });
}

std::size_t BagMessages::rank_of(const std::string& topic) const {
  const auto found = std::find(names_.begin(), names_.end(), without_leading_slash(topic));
  return static_cast<std::size_t>(found - names_.begin());
}

Stamp BagMessages::last_time() const {
  Stamp last = first_time();
  for (const PlacedChunk& placed : chunks_) last = std::max(last, placed.chunk->last);
  return last;
}

void BagMessages::load(const PlacedChunk& placed) {
  std::set<BagFile::ConnectionId> wanted;
  std::map<const BagConnection*, std::size_t> ranks;
  for (const auto& [id, connection] : placed.file->connections()) {
    const std::size_t rank = rank_of(connection->topic);
    if (rank >= names_.size()) continue;
    wanted.insert(id);
    ranks[connection.get()] = rank;
  }
  Loaded loaded;
  std::vector<BagMessage> messages = placed.file->read(*placed.chunk, wanted);
  loaded.messages.reserve(messages.size());
  for (BagMessage& message : messages) {
    const std::size_t rank = ranks.at(&message.connection());
    loaded.messages.push_back({rank, loaded_++, std::move(message)});
  }
  if (loaded.messages.empty()) return;
  const auto is_earlier = [](const Placed& a, const Placed& b) { return a.key() < b.key(); };
  if (!std::is_sorted(loaded.messages.begin(), loaded.messages.end(), is_earlier)) {
    std::sort(loaded.messages.begin(), loaded.messages.end(), is_earlier);
  }
  chunks_at_hand_.push_back(std::move(loaded));
  std::push_heap(chunks_at_hand_.begin(), chunks_at_hand_.end(), IsLater());
}

const BagMessage* BagMessages::peek() {
  while (next_chunk_ < chunks_.size() &&
         (chunks_at_hand_.empty() ||
          chunks_[next_chunk_].chunk->first <= chunks_at_hand_.front().front().message.time())) {
    load(chunks_[next_chunk_++]);
  }
  return chunks_at_hand_.empty() ? nullptr : &chunks_at_hand_.front().front().message;
}

std::optional<BagMessage> BagMessages::next() {
  if (peek() == nullptr) return std::nullopt;
  std::pop_heap(chunks_at_hand_.begin(), chunks_at_hand_.end(), IsLater());
  Loaded& chunk = chunks_at_hand_.back();
  std::optional<BagMessage> message(std::move(chunk.messages[chunk.next++].message));
  if (chunk.next == chunk.messages.size()) {
    chunks_at_hand_.pop_back();
  } else {
    std::push_heap(chunks_at_hand_.begin(), chunks_at_hand_.end(), IsLater());
  }
  return message;
}

}  // namespace urban_gnss
