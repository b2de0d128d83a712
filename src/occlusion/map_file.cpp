#include "urban_gnss_localization/occlusion/map_file.hpp"

#include <algorithm>
#include <filesystem>
#include <stdexcept>
#include <system_error>

#include "urban_gnss_localization/common/control_characters.hpp"

namespace urban_gnss {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kLongestPath = 4095;

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
  write_pcd(path, map);
}

}  // namespace urban_gnss
