#pragma once

#include <map>

#include "urban_gnss_localization/receivers/gps_common_decoder.hpp"

namespace urban_gnss {

/// The driver novatel_gps_driver (OEM6 and OEM7 documents: TRACKSTAT, GPGSV). Fixes and velocities are of GPSFix.
///
/// Trackstat has a pseudorange residual, C/N0 and a reject code for each channel; Gpgsv has azimuth and elevation,
/// four satellites a message. The two are joined by satellite: of a satellite's channels the first that was used
/// ("GOOD"), else the strongest. Directions are remembered for a minute. While no Trackstat comes, the satellites of
/// Gpgsv are given alone. Residuals of channels that were not used are left out.
///
/// The driver stamps both with their arrival, apart from the fix: SolutionMatcher finds the fix.
class NovatelDecoder : public GpsCommonDecoder {
 public:
  NovatelDecoder();

  void add(ReceiverRole role, const MessageView& message, Stamp arrival) override;
  void finish() override;

 protected:
  void on_fix(Stamp stamp) override;

 private:
  struct Direction {
    LookAngles look;
    Stamp stamp{0};
  };

  void add_trackstat(const MessageView& message, Stamp stamp);
  void add_gpgsv(const MessageView& message, Stamp stamp);
  void give_gpgsv();
  void take_matched_satellites();

  std::map<SatelliteId, Direction> directions_;
  SatelliteEpoch gpgsv_;  ///< of the sequence of messages that is open
  std::optional<Stamp> last_trackstat_;
  SolutionMatcher matcher_;
};

}  // namespace urban_gnss
