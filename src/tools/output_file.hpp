#pragma once

#include <filesystem>
#include <fstream>
#include <functional>
#include <stdexcept>

namespace urban_gnss {

/// Writes a file, and its folder where that is missing. Throws std::runtime_error where not all of it arrives.
inline void write_file(const std::filesystem::path& path, const std::function<void(std::ostream&)>& write) {
  if (path.has_parent_path()) std::filesystem::create_directories(path.parent_path());
  std::ofstream file(path, std::ios::binary);
  if (!file) throw std::runtime_error(path.string() + ": cannot be written");
  write(file);
  file.close();
  if (!file) throw std::runtime_error(path.string() + ": could not be written in full");
}

}  // namespace urban_gnss
