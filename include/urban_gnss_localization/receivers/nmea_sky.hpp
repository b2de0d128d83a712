#pragma once

#include <map>
#include <string>
#include <vector>

#include "urban_gnss_localization/gnss/satellite_epoch.hpp"
#include "urban_gnss_localization/receivers/nmea_sentence.hpp"
#include "urban_gnss_localization/receivers/signal_strengths.hpp"

namespace urban_gnss {

/// The satellites of one solution, out of sentences GSV (azimuth, elevation, C/N0), GSA (which are used) and GRS
/// (residuals of those).
///
/// A satellite that several groups of GSV list (one for each of its signals, or two talkers) is one satellite, with the
/// direction that came last and the C/N0 of its first signal (signal_strengths.hpp).
///
/// A GRS has no names: its residuals are of the satellites of the GSA of the same system, in their order; the second
/// GRS of a system and signal is of its second GSA. Where neither has a system (before NMEA 4.10, talker GN), the first
/// GRS is of the first GSA, and so on. Of several signals the first that has a residual counts. NMEA's residual is
/// computed minus measured; SatelliteObservation has the opposite sign.
class NmeaSky {
 public:
  void add_gsv(const NmeaSentence& sentence);
  void add_gsa(const NmeaSentence& sentence);
  void add_grs(const NmeaSentence& sentence);

  /// Whether there was a GSV, if only to say that nothing is in view.
  bool has_gsv() const { return has_gsv_; }
  /// Satellites that sentence GSV lists with a number that no system has.
  int unknown_numbers() const { return unknown_numbers_; }
  /// Step to which azimuth and elevation are rounded; 0 without any.
  double angle_resolution_rad() const { return angle_resolution_rad_; }

  /// In the order of their systems and numbers, with the residuals that are known.
  std::vector<SatelliteObservation> satellites() const;

 private:
  struct UsedList {
    Constellation system;
    std::string talker;
    std::vector<std::optional<SatelliteId>> satellites;  ///< in the fields' order; nothing where one names none
  };
  struct ResidualList {
    Constellation system;
    std::string talker;
    std::string signal;
    std::vector<double> residuals_m;  ///< in the fields' order and sign; NaN where empty
  };

  const UsedList* list_of(std::size_t residual_list) const;

  std::map<SatelliteId, SatelliteSignals> in_view_;
  std::vector<UsedList> used_;
  std::vector<ResidualList> residuals_;
  bool has_gsv_{false};
  int unknown_numbers_{0};
  double angle_resolution_rad_{0.0};
};

}  // namespace urban_gnss
