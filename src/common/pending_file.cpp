#include "urban_gnss_localization/common/pending_file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <climits>
#include <csignal>
#include <cstring>
#include <initializer_list>
#include <vector>

namespace urban_gnss {
namespace {

namespace fs = std::filesystem;

/// Paths of the pending files, for the handler of a signal, which can use nothing that allocates.
struct Slot {
  std::atomic<bool> is_taken{false};
  std::atomic<bool> is_filled{false};
  char path[PATH_MAX]{};
};
std::array<Slot, 64> slots;

void remember(const fs::path& path) {
  const std::string text = path.string();
  if (text.size() >= PATH_MAX) return;
  for (Slot& slot : slots) {
    if (slot.is_taken.exchange(true)) continue;
    std::strcpy(slot.path, text.c_str());
    slot.is_filled = true;
    return;
  }
}

void forget(const fs::path& path) {
  for (Slot& slot : slots) {
    if (!slot.is_filled || path != slot.path) continue;
    slot.is_filled = false;
    slot.is_taken = false;
  }
}

void remove_and_end(int signal) {
  for (Slot& slot : slots) {
    if (slot.is_filled) unlink(slot.path);
  }
  std::signal(signal, SIG_DFL);
  raise(signal);
}

std::runtime_error error_of(const fs::path& path, const std::string& what, int number) {
  return std::runtime_error(path.string() + ": " + what + ": " + std::strerror(number));
}

/// The file that is meant where links are followed, also where it does not exist yet.
fs::path resolve(const fs::path& path) {
  constexpr int kMostLinks = 40;
  fs::path resolved = path;
  std::error_code error;
  for (int i = 0; fs::is_symlink(fs::symlink_status(resolved, error)); ++i) {
    if (i == kMostLinks) throw error_of(path, "cannot be written", ELOOP);
    resolved = resolved.parent_path() / fs::read_symlink(resolved);
  }
  return resolved;
}

/// A new file with the mode of the one that it replaces. Throws std::runtime_error.
void create(const fs::path& path, const fs::path& target, const struct stat* replaced) {
  constexpr mode_t kModes = 07777;
  constexpr mode_t kUsualMode = 0666;
  const int file = open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, kUsualMode);
  if (file < 0) throw error_of(target, "cannot be written", errno);
  if (replaced != nullptr) static_cast<void>(fchmod(file, replaced->st_mode & kModes));
  close(file);
}

/// A name beside the file, which is short enough also where the file's is not.
fs::path beside(const fs::path& file) {
  constexpr std::size_t kLongestName = 200;
  const std::string name = file.filename().string().substr(0, kLongestName);
  return file.parent_path() / (name + ".part-" + std::to_string(getpid()));
}

}  // namespace

PendingFile::PendingFile(const fs::path& target) : target_(target), resolved_(resolve(target)) {
  struct stat status {};
  const bool exists = stat(resolved_.c_str(), &status) == 0;
  if (!exists && errno != ENOENT) throw error_of(target, "cannot be written", errno);
  if (!resolved_.has_filename() || (exists && S_ISDIR(status.st_mode))) {
    throw error_of(target, "cannot be written", EISDIR);
  }
  if (exists && access(resolved_.c_str(), W_OK) != 0) throw error_of(target, "cannot be written", errno);
  is_direct_ = exists && !S_ISREG(status.st_mode);
  pending_ = is_direct_ ? resolved_ : beside(resolved_);
  if (is_direct_) return;
  remember(pending_);  // first, for a signal may come as soon as it exists
  try {
    create(pending_, target_, exists ? &status : nullptr);
  } catch (const std::runtime_error&) {
    forget(pending_);
    throw;
  }
}

PendingFile::~PendingFile() {
  if (is_direct_ || pending_.empty()) return;
  unlink(pending_.c_str());
  forget(pending_);
}

void PendingFile::commit() {
  if (is_direct_ || pending_.empty()) return;
  if (std::rename(pending_.c_str(), resolved_.c_str()) != 0) throw error_of(target_, "cannot be replaced", errno);
  forget(pending_);
  pending_.clear();
}

std::string PendingFile::reason() const {
  const int file = open(pending_.c_str(), O_WRONLY | O_APPEND | O_CLOEXEC);
  if (file < 0) return std::strerror(errno);
  constexpr std::size_t kBlock = 1 << 16;  // more than the rest of a block may take
  const std::vector<char> block(kBlock, 0);
  const ssize_t written = write(file, block.data(), block.size());
  // A shorter write is followed by the one that says why.
  const bool failed = written < 0 || (written < static_cast<ssize_t>(kBlock) && write(file, block.data(), kBlock) < 0);
  const int number = errno;
  close(file);
  return failed ? std::strerror(number) : "";
}

std::runtime_error PendingFile::failure(const std::string& otherwise) const {
  const std::string of_disk = is_direct_ ? std::strerror(errno) : reason();
  const std::string why = of_disk.empty() ? otherwise : of_disk;
  return std::runtime_error(target_.string() + ": could not be written in full" + (why.empty() ? "" : ": " + why));
}

void remove_pending_files_on_signals() {
  for (const int signal : {SIGHUP, SIGINT, SIGTERM, SIGQUIT, SIGPIPE}) {
    if (std::signal(signal, remove_and_end) == SIG_IGN) std::signal(signal, SIG_IGN);  // as nohup has it
  }
  std::signal(SIGXFSZ, SIG_IGN);
}

}  // namespace urban_gnss
