#pragma once

#include <filesystem>
#include <stdexcept>
#include <string>

namespace urban_gnss {

/// A file that appears whole or not at all: it is written beside its target, and takes its place in one step. Until
/// then, and where that does not happen, an older file of this name stays as it is. A target that is a link stays one:
/// what it points to is replaced. What is no regular file, as /dev/stdout, is written directly.
class PendingFile {
 public:
  /// Throws std::runtime_error that names the file where it is a folder, is write-protected, or nothing can be written
  /// beside it.
  explicit PendingFile(const std::filesystem::path& target);
  PendingFile(const PendingFile&) = delete;
  PendingFile& operator=(const PendingFile&) = delete;
  /// Removes what was not committed.
  ~PendingFile();

  /// Where to write until commit().
  const std::filesystem::path& path() const { return pending_; }
  const std::filesystem::path& target() const { return target_; }

  /// Puts the file, which is closed by now, into its place. Throws std::runtime_error where it cannot.
  void commit();

  /// "out.bag: could not be written in full: No space left on device". Asks the disk for the reason;
  /// `otherwise` stands there if it takes more.
  std::runtime_error failure(const std::string& otherwise = "") const;

 private:
  std::string reason() const;

  std::filesystem::path target_;    ///< as it was asked for
  std::filesystem::path resolved_;  ///< without links
  std::filesystem::path pending_;
  bool is_direct_{false};
};

/// For a program that is not a node: a signal that ends it removes its pending files first, and a file that grows
/// beyond the limit of the process is an error of writing instead of a signal.
void remove_pending_files_on_signals();

}  // namespace urban_gnss
