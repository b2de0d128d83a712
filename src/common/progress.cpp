#include "urban_gnss_localization/common/progress.hpp"

#include <unistd.h>

#include <iostream>
#include <utility>

namespace urban_gnss {

Progress::Progress(std::size_t total, std::string unit)
    : total_(total), unit_(std::move(unit)), is_terminal_(isatty(STDERR_FILENO) == 1) {}

void Progress::report(std::size_t done, const std::string& detail) {
  const std::size_t steps = is_terminal_ ? 1000 : 10;
  const std::size_t shown = done * steps / total_;
  if (shown == last_shown_ && done != total_) return;
  last_shown_ = shown;
  std::cerr << (is_terminal_ ? "\r\033[K" : "") << done << "/" << total_ << " " << unit_
            << (detail.empty() ? "" : "  " + detail) << (is_terminal_ ? "" : "\n") << std::flush;
}

void Progress::finish() {
  if (is_terminal_) std::cerr << "\r\033[K" << std::flush;
}

}  // namespace urban_gnss
