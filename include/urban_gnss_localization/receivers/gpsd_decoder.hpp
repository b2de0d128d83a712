#pragma once

#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "urban_gnss_localization/common/parameters.hpp"
#include "urban_gnss_localization/receivers/fix_noise_from_dop.hpp"
#include "urban_gnss_localization/receivers/gpsd_reports.hpp"
#include "urban_gnss_localization/receivers/receiver_output.hpp"

namespace urban_gnss {

/// Which clock the stamps are of.
enum class GpsdStamps { kArrival, kUtc };

inline EnumNames<GpsdStamps> enum_names(GpsdStamps) {
  return {{"arrival", GpsdStamps::kArrival}, {"utc", GpsdStamps::kUtc}};
}

struct GpsdParameters {
  std::string device;
  GpsdStamps stamps{GpsdStamps::kArrival};
  bool accept_simulated{false};
  DopNoiseParameters noise;

  void visit(ParameterVisitor& v) {
    v.basic()("device", device, "the device of gpsd that is used, /dev/ttyACM0; empty: the first that reports");
    v.basic()("stamps", stamps,
              "of fixes: arrival of a solution's first report by the robot's clock, or the receiver's utc, which is "
              "better where the robot's clock is set by it");
    v("accept_simulated", accept_simulated, "take fixes that the receiver says are simulated, as from a test bench");
    v.group("noise", noise, "A fix's covariance where the receiver declares none.");
  }
};

/// The reports of gpsd (lines of JSON, gpsd_json(5), since 3.19) in, solutions out.
///
/// Reports TPV, GST and SKY with the same time are of one solution, which grows: the last TPV counts, and SKYs are put
/// together, for gpsd sends one after each group of GSV. From NMEA a SKY has no time, and comes before or behind its
/// TPV, by the receiver. It is of the TPV or GST that comes next, where that has a new time; where the same time, or
/// nothing for a while, comes next, it is of the TPV before it. A solution is complete when a TPV with another time
/// comes, and at settle(), which is to be called where nothing has come for a while. Satellites that come later still
/// have their solution's stamp.
///
/// - There is a fix with mode 2 or 3, unless gpsd says that the receiver reckons (status 5) or simulates (8). Altitude
///   is altHAE; unknown in mode 2.
/// - The covariance is GST's. Else it is made of what gpsd estimates: epx, epy, epv are of 95 % (1.96 sigma), as eph is
///   (2.45 sigma of an axis). From u-blox's own protocol eph, epv and eps are the receiver's, of one sigma. Without
///   these it is made of the dilutions, as NMEA's (fix_noise_from_dop.hpp).
/// - Of several devices only one is used.
class GpsdDecoder {
 public:
  explicit GpsdDecoder(const GpsdParameters& parameters = {}) : parameters_(parameters) {}

  /// One line. Takes any bytes. `arrival`: by the robot's clock; without it stamps are UTC.
  void add(std::string_view line, std::optional<Stamp> arrival = std::nullopt);
  /// What was completed since it was asked last.
  ReceiverOutput take();
  /// Nothing has come for a while: the open solution is complete.
  void settle();
  /// A new connection: the device, and what is open, are forgotten.
  void reset();

  /// Of gpsd itself ("3.22"), empty before it said so.
  const std::string& release() const { return release_; }
  const std::string& device() const { return device_; }
  /// Of the last report TPV; 0 before there is one.
  int mode() const { return mode_; }

 private:
  struct Solution {
    std::optional<Stamp> time;     ///< UTC
    std::optional<Stamp> arrival;  ///< of the first report
    GpsdPosition position;
    std::optional<GpsdErrors> errors;
    GpsdSky sky;
    std::optional<Stamp> stamp;  ///< once it is given out
    bool is_given_out{false};
    bool satellites_given_out{false};
  };
  /// Since the last TPV.
  struct Pending {
    std::vector<GpsdSky> skies;
    std::optional<GpsdErrors> errors;
  };

  void take_position(const GpsdPosition& position, std::optional<Stamp> arrival);
  void take_sky(const GpsdSky& sky);
  void take_errors(const GpsdErrors& errors);
  void take_pending();
  bool is_of_open(std::optional<Stamp> time) const;
  bool is_used(const std::string& device);
  void give_out();
  void give_out_fix();
  void give_out_satellites();
  RawFix fix() const;
  void set_covariance(RawFix& fix) const;
  std::optional<RawVelocity> velocity() const;
  bool comes_from_ublox() const;
  void warn_once(const std::string& warning);

  GpsdParameters parameters_;
  ReceiverOutput output_;
  std::optional<Solution> open_;
  Pending pending_;
  std::string release_;
  std::string device_;
  int mode_{0};
  std::map<std::string, std::string> drivers_;  ///< by device
  std::set<std::string> said_;
};

}  // namespace urban_gnss
