#pragma once

#include <optional>

#include "urban_gnss_localization/receivers/receiver_decoder.hpp"
#include "urban_gnss_localization/receivers/solution_matcher.hpp"

namespace urban_gnss {

/// How a driver fills gps_common/GPSFix.
struct GpsCommonSettings {
  std::optional<SatelliteId> (*satellite_of)(int number);
  /// `time` is UTC, and header.stamp the time of arrival. The UTC is then the stamp while the two agree to 2 s; else
  /// the clock of the robot is another, or the driver wrong, and header.stamp is taken, with a warning.
  bool time_is_utc{false};
};

/// Drivers that publish gps_common/GPSFix: gpsd_client, septentrio_gnss_driver, novatel_gps_driver. A fix that comes
/// again with the same time is given once; satellites that it then has in addition are given again with those before,
/// as gpsd reports one constellation after the other. GPSStatus of a topic of its own is taken where the fixes list no
/// satellites.
class GpsCommonDecoder : public ReceiverDecoder {
 public:
  explicit GpsCommonDecoder(const GpsCommonSettings& settings) : settings_(settings) {}

  void add(ReceiverRole role, const MessageView& message, Stamp arrival) override;
  void finish() override;

 protected:
  /// Called with the stamp of each new fix.
  virtual void on_fix(Stamp /*stamp*/) {}

 private:
  void add_fix(const MessageView& message, Stamp arrival);
  void add_satellites(SatelliteEpoch epoch, bool is_new_fix);
  Stamp stamp_of_fix(const MessageView& message, Stamp arrival);
  void take_matched();

  GpsCommonSettings settings_;
  SolutionMatcher statuses_;
  SatelliteEpoch last_satellites_;   ///< of the last fix
  std::optional<double> last_time_;  ///< `time` of the last fix, or its header.stamp in s
  Stamp last_stamp_{0};
  bool lists_satellites_{false};  ///< fixes have had satellites of their own
  bool has_disagreed_{false};
  int agreements_{0};  ///< of `time` with header.stamp, in a row
};

}  // namespace urban_gnss
