#pragma once

#include <CLI/CLI.hpp>
#include <algorithm>
#include <exception>
#include <filesystem>
#include <functional>
#include <iostream>
#include <new>
#include <set>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "files/input_files.hpp"
#include "urban_gnss_localization/common/parameters.hpp"
#include "urban_gnss_localization/common/pending_file.hpp"
#include "urban_gnss_localization/common/edit_distance.hpp"

namespace urban_gnss {

/// The shell of a command-line program: --help, the options that several programs share, the files that it must not
/// write because it reads them, and what happens to errors.
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
  /// A file to write. No two of them may be the same one, nor one that the program reads: all other options that name a
  /// file are taken for what it reads.
  CLI::Option* add_output(const std::string& name, std::string& file, const std::string& what) {
    CLI::Option* const option = app_.add_option(name, file, what);
    outputs_.push_back(option);
    return option;
  }
  /// A folder to write into. What is in it is no input.
  CLI::Option* add_output_folder(const std::string& name, std::string& folder, const std::string& what) {
    CLI::Option* const option = app_.add_option(name, folder, what);
    output_folders_.push_back(option);
    return option;
  }
  /// Where this option is given, the outputs are folders, and the program checks the files that it writes there.
  void outputs_are_folders_with(const CLI::Option* option) { folders_with_ = option; }
  void add_json(std::string& file) { add_output("--json", file, "write the results here"); }
  void add_jobs(int& threads) {
    threads = static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
    app_.add_option("--jobs", threads, "threads")->check(CLI::PositiveNumber);
  }

  /// A file, or the files of a folder, that the program reads although no option names it.
  void reads(const std::filesystem::path& path) {
    inputs_.add(path);
    check_outputs();
  }
  void reads(const std::vector<std::filesystem::path>& paths) {
    for (const std::filesystem::path& path : paths) reads(path);
  }
  const InputFiles& inputs() const { return inputs_; }

  /// How the program was called, for reports.
  const std::string& command() const { return command_; }

  /// Reads the options and does the work. The exit status: 1 where either fails, with the reason on standard error.
  int run(int argc, char** argv, const std::function<void()>& work) {
    try {
      require_options(argc, argv);
      app_.parse(argc, argv);
    } catch (const CLI::ParseError& error) {
      return app_.exit(error) == 0 ? 0 : 1;
    }
    command_ = "rosrun urban_gnss_localization " + program_;
    for (int i = 1; i < argc; ++i) command_ += std::string(" ") + argv[i];
    remove_pending_files_on_signals();
    try {
      find_inputs();
      check_outputs();
      work();
    } catch (const std::bad_alloc&) {
      std::cerr << program_ << ": not enough memory; the command was " << command_.substr(command_.find(program_))
                << inputs_.unless_named_in("") << '\n';
      return 1;
    } catch (const ParameterError& error) {  // names the file, if there is one
      std::cerr << program_ << ": " << error.what() << '\n';
      return 1;
    } catch (const std::exception& error) {
      std::cerr << program_ << ": " << error.what() << inputs_.unless_named_in(error.what()) << '\n';
      return 1;
    }
    return 0;
  }

 private:
  /// Throws CLI::ExtrasError for the first option that there is not, with what may be meant. CLI11 would blame its
  /// value, which it takes for a file to read.
  void require_options(int argc, char** argv) const {
    for (int i = 1; i < argc && std::string(argv[i]) != "--"; ++i) {
      const std::string argument = argv[i];
      const std::string name = argument.substr(0, argument.find('='));
      if (name.rfind("--", 0) != 0 || app_.get_option_no_throw(name) != nullptr) continue;
      std::vector<std::string> known;
      for (const CLI::Option* option : app_.get_options()) {
        for (const std::string& each : option->get_lnames()) known.push_back("--" + each);
      }
      const auto nearest = nearest_name(name, known);
      throw CLI::ExtrasError(name + ": no such option" + (nearest ? "; did you mean " + known[*nearest] + "?" : ""),
                             CLI::ExitCodes::ExtrasError);
    }
  }
  static bool has(const std::vector<const CLI::Option*>& options, const CLI::Option* option) {
    return std::find(options.begin(), options.end(), option) != options.end();
  }

  /// All values of options that are files, also behind a `=`.
  void find_inputs() {
    for (const CLI::Option* option : app_.get_options()) {
      if (has(outputs_, option) || has(output_folders_, option)) continue;
      for (const std::string& value : option->results()) {
        if (value.empty()) continue;
        inputs_.add_file(value);
        inputs_.add_file(value.substr(value.find('=') + 1));
      }
    }
  }
  void check_outputs() const {
    if (folders_with_ != nullptr && folders_with_->count() > 0) return;
    std::set<std::filesystem::path> known;
    for (const CLI::Option* option : outputs_) {
      if (option->count() == 0 || option->results().back().empty()) continue;
      const std::filesystem::path path = inputs_.checked(option->results().back());
      std::error_code error;
      const auto whole = std::filesystem::weakly_canonical(std::filesystem::absolute(path, error), error);
      const bool is_file = !std::filesystem::exists(path, error) || std::filesystem::is_regular_file(path, error);
      if (is_file && !known.insert(whole).second) {
        throw std::runtime_error(option->get_name() + " " + path.string() + ": another option writes this file, too");
      }
    }
  }

  std::string program_;
  std::string command_;
  CLI::App app_;
  std::vector<const CLI::Option*> outputs_;
  std::vector<const CLI::Option*> output_folders_;
  const CLI::Option* folders_with_{nullptr};
  InputFiles inputs_;
};

}  // namespace urban_gnss
