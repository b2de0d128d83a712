#include "urban_gnss_localization/common/progress.hpp"

#include <unistd.h>

#include <iostream>
#include <utility>

namespace urban_gnss {

Progress::Progress(std::size_t total, std::string unit)
    : total_(total), unit_(std::move(unit)), is_terminal_(isatty(STDERR_FILENO) == 1) {}

std::string Progress::count(std::size_t done) const {
  return std::to_string(done) + "/" + std::to_string(total_) + " " + unit_;
}

std::string Progress::percent(std::size_t done) const {
  const std::size_t tenths = done * 1000 / total_;
  return std::to_string(tenths / 10) + "." + std::to_string(tenths % 10) + " %";
}

void Progress::report(std::size_t done, const std::string& detail) {
  const std::size_t steps = is_terminal_ ? 1000 : 10;
  const std::size_t shown = done * steps / total_;
  if (shown == last_shown_ && done != total_) return;
  last_shown_ = shown;
  std::cerr << (is_terminal_ ? "\r\033[K" : "") << (unit_.empty() ? percent(done) : count(done))
            << (detail.empty() ? "" : "  " + detail) << (is_terminal_ ? "" : "\n") << std::flush;
}

void Progress::finish() {
  if (is_terminal_) std::cerr << "\r\033[K" << std::flush;
}

}  // namespace urban_gnss
