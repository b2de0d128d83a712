#pragma once

#include <array>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "urban_gnss_localization/pipeline/input_clocks.hpp"
#include "urban_gnss_localization/pipeline/pipeline_event.hpp"

namespace urban_gnss {

/// What a clock may be that is off by so much, for people: " (GPS time in place of UTC?)"; empty where nothing is
/// known.
std::string clock_hint(double offset_s);

/// Compares the newest stamps of the streams as their messages come: what comes together should be of about the same
/// time. A stream that is ahead of the odometry by half a second and more has another clock (no message comes before it
/// was measured), and so has an IMU that is behind the step before; fixes and velocities may be late by 2.5 s. Only the
/// order of the messages counts, so that live and offline see the same.
class StreamOffsets {
 public:
  /// A message of a stream other than the odometry came.
  void add(InputStream stream, Stamp stamp);
  /// One of the odometry came. Says once of each stream that it is off.
  void add_odometry(Stamp stamp, std::vector<PipelineEvent>& events);

  /// s by which the stream's stamps are ahead (> 0) or behind; nothing where they are as they should be.
  std::optional<double> offset_s(InputStream stream) const;
  /// "fixes are 18.0 s ahead of the odometry (GPS time in place of UTC?)"; empty where they are not.
  std::string describe(InputStream stream) const;
  void reset() { *this = StreamOffsets(); }

 private:
  struct Stream {
    std::optional<Stamp> newest;  ///< since the last odometry
    std::deque<double> offsets_s;
    std::optional<double> off_s;
  };
  static constexpr std::size_t kStreams = static_cast<std::size_t>(InputStream::kEstimates) + 1;
  std::array<Stream, kStreams> streams_;
  std::optional<Stamp> last_odometry_;
};

}  // namespace urban_gnss
