#pragma once

#include <filesystem>
#include <fstream>
#include <functional>
#include <iosfwd>

#include "input_files.hpp"
#include "urban_gnss_localization/common/pending_file.hpp"

namespace urban_gnss {

/// A file that is written, which appears whole, by close(), or not at all.
class OutputFile {
 public:
  /// Makes its folder where that is missing. Throws std::runtime_error that names the file where it is one of `inputs`
  /// or cannot be written.
  OutputFile(const std::filesystem::path& path, const InputFiles& inputs);

  std::ostream& stream() { return stream_; }
  /// Throws std::runtime_error that names the file where not all of it arrives.
  void close();

 private:
  PendingFile pending_;
  std::ofstream stream_;
};

/// An OutputFile at once.
void write_file(const std::filesystem::path& path, const InputFiles& inputs,
                const std::function<void(std::ostream&)>& write);

}  // namespace urban_gnss
