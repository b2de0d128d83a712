#include "urban_gnss_localization/pipeline/stream_offsets.hpp"

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <sstream>

namespace urban_gnss {
namespace {

constexpr std::size_t kCount = 8;
constexpr double kAhead_s = 0.5;
constexpr double kImuBehind_s = 0.3;
constexpr double kReceiverBehind_s = 2.5;
constexpr double kGpsTime_s = 18.0;  ///< ahead of UTC, since 2017
constexpr double kTai_s = 37.0;
constexpr double kLeapTolerance_s = 0.9;
constexpr double kQuarter_s = 900.0;
constexpr double kQuarterTolerance_s = 2.0;
constexpr double kDay_s = 86400.0;

double behind_s(InputStream stream) { return stream == InputStream::kImu ? kImuBehind_s : kReceiverBehind_s; }

const char* effect_of(InputStream stream, double offset_s) {
  if (stream == InputStream::kImu)
    return offset_s < 0.0 ? "its yaw rate comes too late to be used"
                          : "its clock is off, or the odometry comes late; it is not used until turns tell which";
  return offset_s < 0.0 ? "a slow receiver, or a clock that is off" : "their clock is off, or the odometry comes late";
}

}  // namespace

std::string clock_hint(double offset_s) {
  const double size_s = std::abs(offset_s);
  if (std::abs(size_s - kGpsTime_s) < kLeapTolerance_s) {
    return offset_s > 0.0 ? " (GPS time in place of UTC?)" : " (the odometry's in GPS time in place of UTC?)";
  }
  if (std::abs(size_s - kTai_s) < kLeapTolerance_s) return " (TAI in place of UTC?)";
  const double quarters = std::round(size_s / kQuarter_s);
  if (quarters >= 1.0 && size_s < kDay_s && std::abs(size_s - quarters * kQuarter_s) < kQuarterTolerance_s) {
    return " (a time zone in place of UTC?)";
  }
  if (size_s > 365.0 * kDay_s) return " (time since the start in place of the time of day?)";
  return "";
}

void StreamOffsets::add(InputStream stream, Stamp stamp) {
  auto& newest = streams_[static_cast<std::size_t>(stream)].newest;
  newest = newest ? std::max(*newest, stamp) : stamp;
}

void StreamOffsets::add_odometry(Stamp stamp, std::vector<PipelineEvent>& events) {
  const double interval_s = last_odometry_ ? to_seconds(stamp - *last_odometry_) : 0.0;
  last_odometry_ = stamp;
  for (std::size_t i = 0; i < kStreams; ++i) {
    Stream& each = streams_[i];
    if (!each.newest) continue;
    each.offsets_s.push_back(to_seconds(*each.newest - stamp));
    each.newest.reset();
    if (each.offsets_s.size() > kCount) each.offsets_s.pop_front();
    if (each.offsets_s.size() < kCount) continue;
    const auto [least, most] = std::minmax_element(each.offsets_s.begin(), each.offsets_s.end());
    const auto stream = static_cast<InputStream>(i);
    const bool was_off = each.off_s.has_value();
    if (*least > kAhead_s) {
      each.off_s = *least;
    } else if (*most < -behind_s(stream) - interval_s) {
      each.off_s = *most;
    } else {
      each.off_s.reset();
    }
    if (each.off_s.has_value() == was_off) continue;
    if (was_off) {
      events.push_back({PipelineEvent::Level::kInfo,
                        "stamps of " + std::string(to_string(stream)) + " are those of the odometry's clock again"});
    } else {
      events.push_back({PipelineEvent::Level::kWarn, describe(stream) + ": " + effect_of(stream, *each.off_s)});
    }
  }
}

std::optional<double> StreamOffsets::offset_s(InputStream stream) const {
  return streams_[static_cast<std::size_t>(stream)].off_s;
}

std::string StreamOffsets::describe(InputStream stream) const {
  const auto offset_s = this->offset_s(stream);
  if (!offset_s) return {};
  std::ostringstream text;
  text << "stamps of " << to_string(stream) << " are " << std::fixed << std::setprecision(1) << std::abs(*offset_s)
       << (*offset_s > 0.0 ? " s ahead of" : " s behind") << " the odometry's as they come" << clock_hint(*offset_s);
  return text.str();
}

}  // namespace urban_gnss
