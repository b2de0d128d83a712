#pragma once

#include <CLI/CLI.hpp>
#include <algorithm>
#include <exception>
#include <functional>
#include <iostream>
#include <string>
#include <thread>
#include <vector>

namespace urban_gnss {

/// The shell of a command-line program: --help, the options that several programs share, and what happens to errors.
class CommandLine {
 public:
  /// `what` the program does, one sentence.
  CommandLine(std::string program, const std::string& what) : program_(std::move(program)), app_(what) {
    app_.option_defaults()->always_capture_default();
  }

  CLI::App& app() { return app_; }

  void add_seeds(int& count, int& first) {
    app_.add_option("--seeds", count, "how many seeds")->check(CLI::PositiveNumber);
    app_.add_option("--first-seed", first, "the first of them")->check(CLI::NonNegativeNumber);
  }
  void add_scenarios(std::vector<std::string>& scenarios, std::vector<std::string>& overrides) {
    app_.add_option("--scenarios", scenarios, "files, or names of the package's; comma-separated")->delimiter(',');
    app_.add_option("--scenario-set", overrides, "a value of the scenario, SECTION.NAME=VALUE; repeatable");
  }
  void add_duration(double& seconds) {
    app_.add_option("--duration", seconds, "s to simulate at most; default: the scenario's")
        ->check(CLI::PositiveNumber);
  }
  /// `whose`: "a parameter of ukf".
  void add_set(const std::string& option, std::vector<std::string>& overrides, const std::string& whose) {
    app_.add_option(option, overrides, whose + ", as docs/parameters.md names it, NAME=VALUE; repeatable");
  }
  void add_json(std::string& file) { app_.add_option("--json", file, "write the results here"); }
  void add_jobs(int& threads) {
    threads = static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
    app_.add_option("--jobs", threads, "threads")->check(CLI::PositiveNumber);
  }

  /// How the program was called, for reports.
  const std::string& command() const { return command_; }

  /// Reads the options and does the work. The exit status: 1 where either fails, with the reason on standard error.
  int run(int argc, char** argv, const std::function<void()>& work) {
    try {
      app_.parse(argc, argv);
    } catch (const CLI::ParseError& error) {
      return app_.exit(error) == 0 ? 0 : 1;
    }
    command_ = "rosrun urban_gnss_localization " + program_;
    for (int i = 1; i < argc; ++i) command_ += std::string(" ") + argv[i];
    try {
      work();
    } catch (const std::exception& error) {
      std::cerr << program_ << ": " << error.what() << '\n';
      return 1;
    }
    return 0;
  }

 private:
  std::string program_;
  std::string command_;
  CLI::App app_;
};

}  // namespace urban_gnss
