#include "several_recordings.hpp"

#include <fcntl.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstring>
#include <exception>
#include <filesystem>
#include <map>
#include <set>
#include <stdexcept>
#include <system_error>

namespace urban_gnss {
namespace {

constexpr char kDone = '+';
constexpr char kFailed = '-';

void write_all(int file, const std::string& text) {
  for (std::size_t done = 0; done < text.size();) {
    const ssize_t written = write(file, text.data() + done, text.size() - done);
    if (written < 0 && errno != EINTR) return;
    if (written > 0) done += static_cast<std::size_t>(written);
  }
}

std::string read_all(int file) {
  std::string text;
  char block[4096];
  for (;;) {
    const ssize_t size = read(file, block, sizeof(block));
    if (size < 0 && errno == EINTR) continue;
    if (size <= 0) return text;
    text.append(block, static_cast<std::size_t>(size));
  }
}

[[noreturn]] void be_child(int answer, const std::function<std::string()>& work) {
  prctl(PR_SET_PDEATHSIG, SIGTERM);
  const int nowhere = open("/dev/null", O_WRONLY | O_CLOEXEC);
  dup2(nowhere, STDOUT_FILENO);
  dup2(nowhere, STDERR_FILENO);
  std::string text;
  try {
    text = kDone + work();
  } catch (const std::exception& error) {
    text = kFailed + std::string(error.what());
  }
  write_all(answer, text);
  _exit(0);
}

struct Child {
  std::size_t index;
  int answer;
};

RecordingResult result_of(const Child& child, int status) {
  const std::string text = read_all(child.answer);
  close(child.answer);
  if (WIFSIGNALED(status)) return {false, std::string("ended by a signal: ") + strsignal(WTERMSIG(status))};
  if (text.empty()) return {false, "ended without a word"};
  return {text.front() == kDone, text.substr(1)};
}

}  // namespace

void run_in_processes(std::size_t count, int jobs, const std::function<std::string(std::size_t)>& work,
                      const std::function<void(std::size_t, const RecordingResult&)>& report) {
  std::map<pid_t, Child> running;
  for (std::size_t next = 0; next < count || !running.empty();) {
    if (next < count && running.size() < static_cast<std::size_t>(jobs)) {
      int ends[2];
      if (pipe2(ends, O_CLOEXEC) != 0) throw std::system_error(errno, std::generic_category(), "pipe");
      const pid_t child = fork();
      if (child < 0) throw std::system_error(errno, std::generic_category(), "fork");
      if (child == 0) be_child(ends[1], [&] { return work(next); });
      close(ends[1]);
      running[child] = {next++, ends[0]};
      continue;
    }
    int status = 0;
    const pid_t ended = waitpid(-1, &status, 0);
    const auto found = running.find(ended);
    if (found == running.end()) {
      if (ended < 0 && errno != EINTR) throw std::system_error(errno, std::generic_category(), "waitpid");
      continue;
    }
    report(found->second.index, result_of(found->second, status));
    running.erase(found);
  }
}

void require_names_of_their_own(const std::vector<std::string>& bags) {
  std::set<std::string> stems;
  for (const std::string& bag : bags) {
    const std::string stem = std::filesystem::path(bag).stem().string();
    if (!stems.insert(stem).second) {
      throw std::runtime_error("two bags are named " + stem + ": their results would be one");
    }
  }
}

std::vector<std::string> files_beside(const std::string& folder, const std::vector<std::string>& bags,
                                      const std::string& extension) {
  std::vector<std::string> files;
  for (const std::string& bag : bags) {
    files.push_back(
        (std::filesystem::path(folder) / (std::filesystem::path(bag).stem().string() + extension)).string());
  }
  return files;
}

}  // namespace urban_gnss
