#include "urban_gnss_localization/ros/plotting.hpp"

#include <ros/package.h>
#include <spawn.h>
#include <sys/wait.h>

#include <cerrno>
#include <filesystem>
#include <iostream>
#include <stdexcept>

extern char** environ;

namespace urban_gnss {

void run_plotter(const std::string& script, const std::string& directory) {
  namespace fs = std::filesystem;
  const fs::path package = ros::package::getPath("urban_gnss_localization");
  const fs::path path = package / "reports" / script;
  if (package.empty() || !fs::exists(path)) {
    throw std::runtime_error(script + ": not found; source the workspace's setup.bash so that the package is found");
  }
  std::string python = fs::exists("/usr/bin/python3") ? "/usr/bin/python3" : "python3";
  std::string file = path.string();
  std::string argument = directory;
  char* const arguments[] = {python.data(), file.data(), argument.data(), nullptr};
  std::cout.flush();
  pid_t child = 0;
  if (posix_spawnp(&child, python.c_str(), nullptr, nullptr, arguments, environ) != 0) {
    throw std::runtime_error(python + ": cannot be started");
  }
  int status = 0;
  while (waitpid(child, &status, 0) < 0) {
    if (errno != EINTR) throw std::runtime_error(script + ": was lost");
  }
  if (!WIFEXITED(status) || WEXITSTATUS(status) != 0) throw std::runtime_error(script + " " + directory + ": failed");
}

}  // namespace urban_gnss
