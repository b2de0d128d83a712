#pragma once

#include <limits>
#include <map>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "urban_gnss_localization/common/stamp.hpp"
#include "urban_gnss_localization/gnss/satellite.hpp"
#include "urban_gnss_localization/receivers/signal_strengths.hpp"

/// The reports of gpsd that have a use here, as gpsd_json(5) describes them. What a report lacks is NaN.
namespace urban_gnss {

inline constexpr double kGpsdUnknown = std::numeric_limits<double>::quiet_NaN();

/// TPV.
struct GpsdPosition {
  std::string device;
  std::optional<Stamp> time;  ///< UTC
  int mode{0};                ///< 0 and 1 no fix, 2 without altitude, 3 with
  int status{0};              ///< 2 DGPS, 3 RTK fixed, 4 RTK float, 5 reckoned, 8 simulated
  double latitude_deg{kGpsdUnknown}, longitude_deg{kGpsdUnknown};
  double altitude_m{kGpsdUnknown};  ///< above the ellipsoid
  double speed_mps{kGpsdUnknown};
  double course_rad{kGpsdUnknown};  ///< clockwise from north
  double epx_m{kGpsdUnknown}, epy_m{kGpsdUnknown}, epv_m{kGpsdUnknown}, eph_m{kGpsdUnknown};
  double eps_mps{kGpsdUnknown};
};

/// GST: standard deviations.
struct GpsdErrors {
  std::string device;
  std::optional<Stamp> time;
  double east_m{kGpsdUnknown}, north_m{kGpsdUnknown}, up_m{kGpsdUnknown};
};

/// SKY.
struct GpsdSky {
  std::string device;
  std::optional<Stamp> time;
  double hdop{kGpsdUnknown}, vdop{kGpsdUnknown};
  bool has_list{false};  ///< of satellites; a report may have the dilutions only
  bool has_whole_degrees{true};
  std::map<SatelliteId, SatelliteSignals> satellites;

  /// Takes a newer report of the same sky. gpsd's skies grow within a receiver's cycle, so that of a satellite in both
  /// the newer counts, and one that the newer lacks is kept.
  void merge(const GpsdSky& other);
};

/// VERSION, DEVICE and DEVICES, ERROR.
struct GpsdVersion {
  std::string release;
  int protocol{0};  ///< proto_major
};
struct GpsdDevices {
  std::map<std::string, std::string> drivers;  ///< by path
};
struct GpsdError {
  std::string message;
};

struct GpsdOther {};       ///< of no use here
struct GpsdUnreadable {};  ///< no object of JSON with a class

using GpsdReport =
    std::variant<GpsdUnreadable, GpsdOther, GpsdPosition, GpsdErrors, GpsdSky, GpsdVersion, GpsdDevices, GpsdError>;

/// One line of gpsd. Takes any bytes; a field of a wrong type is taken as missing.
GpsdReport parse_gpsd_report(std::string_view line);

/// "2017-01-10T00:09:41.000Z".
std::optional<Stamp> parse_gpsd_time(std::string_view text);

}  // namespace urban_gnss
