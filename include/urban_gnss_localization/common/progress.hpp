#pragma once

#include <cstddef>
#include <string>

namespace urban_gnss {

/// How far a long piece of work is, on standard error: one line that renews itself on a terminal, a line every tenth in
/// a log file.
class Progress {
 public:
  /// `total` > 0 pieces, named `unit` (e.g. "runs"); without a name they are shown in percent.
  explicit Progress(std::size_t total, std::string unit = {});

  /// `done` pieces are finished; `detail` says what is at hand.
  void report(std::size_t done, const std::string& detail = {});
  void finish();

 private:
  std::string count(std::size_t done) const;
  std::string percent(std::size_t done) const;

  std::size_t total_;
  std::string unit_;
  bool is_terminal_;
  std::size_t last_shown_{0};
};

}  // namespace urban_gnss
