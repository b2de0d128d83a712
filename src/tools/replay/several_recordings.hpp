#pragma once

#include <functional>
#include <string>
#include <vector>

namespace urban_gnss {

/// What became of one of several recordings.
struct RecordingResult {
  bool is_done{false};
  std::string text;  ///< one line about it; else the reason
};

/// Does the work for each of `count` recordings in a process of its own, `jobs` at a time, without their output, and
/// calls `report` as soon as one has ended. An exception of the work, and a signal, are results that are not done. The
/// caller has no other threads.
void run_in_processes(std::size_t count, int jobs, const std::function<std::string(std::size_t)>& work,
                      const std::function<void(std::size_t, const RecordingResult&)>& report);

/// Throws std::runtime_error where two bags have one name, so that their results would, too.
void require_names_of_their_own(const std::vector<std::string>& bags);

/// "results/drive.json" of a folder and each bag's name. Requires names of their own.
std::vector<std::string> files_beside(const std::string& folder, const std::vector<std::string>& bags,
                                      const std::string& extension);

}  // namespace urban_gnss
