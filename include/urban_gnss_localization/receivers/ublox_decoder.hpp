#pragma once

#include <deque>
#include <optional>

#include "urban_gnss_localization/receivers/receiver_decoder.hpp"

namespace urban_gnss {

/// The driver ublox_gps. http://wiki.ros.org/ublox_gps, u-blox 8/M8 protocol specification (NAV-PVT, NAV-SAT,
/// NAV-SVINFO).
///
/// A solution is known by its time of week (iTOW). NavPVT has position, velocity and UTC: while it comes, `fix` and
/// `fix_velocity`, which the driver makes of it, are left out. Without it they are taken, and the time of week comes of
/// their stamps, which are UTC, plus leap seconds. NavSAT and NavSVINFO have neither header nor stamp, and may come
/// only with every 20th solution, before or after it: they get the stamp of the solution of the same time of week.
/// Residuals are kept for satellites that the solution used, and only where that solution was seen. Without it the
/// directions and C/N0 are given, at the stamp that the time of week tells.
class UbloxDecoder : public ReceiverDecoder {
 public:
  void add(ReceiverRole role, const MessageView& message, Stamp arrival) override;
  void finish() override;

 private:
  struct Solution {
    std::int64_t time_of_week_ms;
    Stamp stamp;
    std::int64_t tolerance_ms;  ///< by which the time of week may be wrong
    bool has_fix;
  };
  struct Waiting {
    std::int64_t time_of_week_ms;
    SatelliteEpoch epoch;
    int solutions_since{0};
  };

  void add_navpvt(const MessageView& message, Stamp arrival);
  void add_fix(const MessageView& message, Stamp arrival);
  void add_velocity(const MessageView& message, Stamp arrival);
  void add_satellites(std::int64_t time_of_week_ms, SatelliteEpoch epoch);

  void give_fix(const RawFix& fix);
  void give_velocity(const RawVelocity& velocity);
  /// Whether NavPVT tells what the driver's message of this stamp would.
  bool navpvt_comes(Stamp stamp) const;
  void note(const Solution& solution);
  /// Gives the satellites with the stamp of their solution; false where it was not seen.
  bool give_with_solution(const Waiting& waiting);
  void give_without_solution(Waiting waiting);

  std::deque<Solution> solutions_;
  std::deque<Waiting> waiting_;
  std::deque<Stamp> given_fixes_;
  std::deque<Stamp> given_velocities_;
  std::optional<Stamp> last_navpvt_;
};

}  // namespace urban_gnss
