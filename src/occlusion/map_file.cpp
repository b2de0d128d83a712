#include "urban_gnss_localization/occlusion/map_file.hpp"

#include <algorithm>
#include <filesystem>
#include <stdexcept>
#include <system_error>

namespace urban_gnss {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kLongestPath = 4095;

bool is_control(char character) { return static_cast<unsigned char>(character) < 0x20 || character == 0x7f; }

}  // namespace

std::string map_file_fault(const std::string& path, bool overwrite) {
  if (std::any_of(path.begin(), path.end(), is_control)) return "file has control characters (a newline, NUL)";
  if (path.size() > kLongestPath) return "file has more than 4095 characters";
  const fs::path file(path);
  if (!file.is_absolute()) return "file = " + path + ": must be an absolute path";
  if (file.extension() != ".pcd") return "file = " + path + ": must end in .pcd";
  std::error_code error;
  if (!fs::is_directory(file.parent_path(), error)) return "file = " + path + ": there is no such folder";
  const fs::file_status status = fs::symlink_status(file, error);
  if (!fs::exists(status)) return {};
  if (!fs::is_regular_file(status)) return "file = " + path + ": is there, and is no ordinary file";
  return overwrite ? std::string() : "file = " + path + ": is there already; set overwrite to replace it";
}

void save_map_file(const std::string& path, const PointCloud& map, bool overwrite) {
  const std::string fault = map_file_fault(path, overwrite);
  if (!fault.empty()) throw std::runtime_error(fault);
  const std::string unfinished = path + ".unfinished.pcd";
  std::error_code error;
  fs::remove(unfinished, error);  // of a run that was killed; never through a link
  try {
    write_pcd(unfinished, map);
  } catch (...) {
    fs::remove(unfinished, error);
    throw;
  }
  fs::rename(unfinished, path, error);
  if (error) {
    const std::string why = error.message();
    fs::remove(unfinished, error);
    throw std::runtime_error(path + ": cannot be written: " + why);
  }
}

}  // namespace urban_gnss
