#include "input_files.hpp"

#include <sys/stat.h>

#include <stdexcept>
#include <system_error>

namespace urban_gnss {

namespace fs = std::filesystem;

namespace {

constexpr std::size_t kMostNamed = 5;

}  // namespace

void InputFiles::add_file(const fs::path& path) {
  struct stat status {};
  if (stat(path.c_str(), &status) != 0 || !S_ISREG(status.st_mode)) return;
  files_.emplace(std::make_pair(status.st_dev, status.st_ino), path.string());
}

void InputFiles::add(const fs::path& path) {
  add_file(path);
  std::error_code error;
  for (fs::directory_iterator entry(path, error), end; !error && entry != end; entry.increment(error)) {
    add_file(entry->path());
  }
}

const fs::path& InputFiles::checked(const fs::path& output) const {
  struct stat status {};
  if (stat(output.c_str(), &status) != 0) return output;
  const auto found = files_.find({status.st_dev, status.st_ino});
  if (found == files_.end()) return output;
  throw std::runtime_error(output.string() + ": is not written, for it is the file that is read as " + found->second);
}

std::string InputFiles::unless_named_in(const std::string& text) const {
  std::string names;
  std::size_t count = 0;
  for (const auto& [identity, path] : files_) {
    if (text.find(fs::path(path).filename().string()) != std::string::npos) return {};
    if (count++ < kMostNamed) names += (names.empty() ? "" : ", ") + path;
  }
  return names.empty() ? "" : " (read: " + names + (count > kMostNamed ? ", …)" : ")");
}

const fs::path& prepared(const fs::path& output, const InputFiles& inputs) {
  inputs.checked(output);
  std::error_code error;
  if (output.has_parent_path()) fs::create_directories(output.parent_path(), error);
  if (error) throw std::runtime_error(output.string() + ": its folder cannot be made: " + error.message());
  return output;
}

}  // namespace urban_gnss
