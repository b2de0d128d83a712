// Bags: every chunk of what opens, with all its messages.

#include "files/bag_file.hpp"
#include "memory_file.hpp"

namespace urban_gnss::fuzz {

void read_bag(const std::string& bytes) {
  read_as_file(bytes, [](const std::string& path) {
    BagFile bag(path);
    std::set<BagFile::ConnectionId> wanted;
    for (const auto& connection : bag.connections()) wanted.insert(connection.first);
    for (const BagFile::Chunk& chunk : bag.chunks()) bag.read(chunk, wanted);
  });
}

}  // namespace urban_gnss::fuzz
