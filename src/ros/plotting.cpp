#include "urban_gnss_localization/ros/plotting.hpp"

#include <ros/package.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <stdexcept>

namespace urban_gnss {

void run_plotter(const std::string& script, const std::string& directory) {
  const std::filesystem::path path =
      std::filesystem::path(ros::package::getPath("urban_gnss_localization")) / "scripts" / script;
  if (!std::filesystem::exists(path)) throw std::runtime_error(path.string() + ": the plot script is missing");
  const std::string python = std::filesystem::exists("/usr/bin/python3") ? "/usr/bin/python3" : "python3";
  const pid_t child = fork();
  if (child < 0) throw std::runtime_error("cannot start " + python);
  if (child == 0) {
    execlp(python.c_str(), python.c_str(), path.c_str(), directory.c_str(), static_cast<char*>(nullptr));
    _exit(127);
  }
  int status = 0;
  if (waitpid(child, &status, 0) != child || !WIFEXITED(status) || WEXITSTATUS(status) != 0) {
    throw std::runtime_error(script + " failed on " + directory);
  }
}

}  // namespace urban_gnss
