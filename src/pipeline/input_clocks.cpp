#include "urban_gnss_localization/pipeline/input_clocks.hpp"

#include "text.hpp"

namespace urban_gnss {
namespace {

constexpr std::size_t kStreamCount = static_cast<std::size_t>(InputStream::kEstimates) + 1;

}  // namespace

const char* to_string(InputStream stream) {
  switch (stream) {
    case InputStream::kOdometry: return "odometry";
    case InputStream::kFixes: return "fixes";
    case InputStream::kImu: return "IMU";
    case InputStream::kVelocities: return "velocities";
    case InputStream::kEstimates: return "estimates";
  }
  return "?";
}

InputClocks::InputClocks(const StampParameters& parameters)
    : reset_on_time_jump_(parameters.reset_on_time_jump), monitors_(kStreamCount, StampMonitor(parameters.time_jump)) {}

bool InputClocks::accept(InputStream stream, Stamp stamp, const std::function<void(const std::string& why)>& reset) {
  return monitors_[static_cast<std::size_t>(stream)].accept(stamp, [&](Stamp back) {
    if (!reset_on_time_jump_) return false;
    reset("the clock of the " + std::string(to_string(stream)) + " jumped back by " + seconds_text(to_seconds(back)));
    this->reset();
    return true;
  });
}

void InputClocks::reset() {
  for (StampMonitor& monitor : monitors_) monitor.reset();
}

}  // namespace urban_gnss
