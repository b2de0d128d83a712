#pragma once

#include <sys/mman.h>
#include <unistd.h>

#include <string>
#include <utility>

#include "target.hpp"

namespace urban_gnss::fuzz {

/// A file in memory, for readers that want a path.
class MemoryFile {
 public:
  explicit MemoryFile(const std::string& bytes) : descriptor_(memfd_create("fuzz", MFD_CLOEXEC)) {
    const bool is_written = write(descriptor_, bytes.data(), bytes.size()) == static_cast<ssize_t>(bytes.size());
    if (!is_written) throw std::runtime_error("no memory for a file");
  }
  ~MemoryFile() { close(descriptor_); }
  MemoryFile(const MemoryFile&) = delete;
  MemoryFile& operator=(const MemoryFile&) = delete;

  std::string path() const { return "/proc/self/fd/" + std::to_string(descriptor_); }

 private:
  int descriptor_;
};

/// Calls read(path of a file with the bytes). Where it refuses the file, it must do so by a std::runtime_error that
/// names it.
template <class Read>
void read_as_file(const std::string& bytes, Read&& read) {
  const MemoryFile file(bytes);
  try {
    std::forward<Read>(read)(file.path());
  } catch (const std::runtime_error& error) {
    const std::string text = error.what();
    require(text.find(file.path()) != std::string::npos, "a refusal that does not name the file: " + text);
  }
}

}  // namespace urban_gnss::fuzz
