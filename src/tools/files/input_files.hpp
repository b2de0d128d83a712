#pragma once

#include <sys/types.h>

#include <filesystem>
#include <map>
#include <string>
#include <utility>

namespace urban_gnss {

/// The files that a program reads, which it must not write. A file is known by its device and inode, so that a link or
/// another way to its folder makes no difference.
class InputFiles {
 public:
  /// A file, or all files of a folder; nothing where there is none of this name.
  void add(const std::filesystem::path& path);
  /// A file; nothing where there is none of this name.
  void add_file(const std::filesystem::path& path);
  /// `output`. Throws std::runtime_error that names both where it is one of the files.
  const std::filesystem::path& checked(const std::filesystem::path& output) const;
  /// For an error that names none of the files: " (read: a.bag, b.yaml)", five at most. Empty where it names one.
  std::string unless_named_in(const std::string& text) const;

 private:
  std::map<std::pair<dev_t, ino_t>, std::string> files_;
};

/// `output`, whose folder is made where it is missing. Throws std::runtime_error that names it where it is one of
/// `inputs`, or where its folder cannot be made.
const std::filesystem::path& prepared(const std::filesystem::path& output, const InputFiles& inputs);

}  // namespace urban_gnss
