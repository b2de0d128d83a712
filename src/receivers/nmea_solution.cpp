#include "urban_gnss_localization/receivers/nmea_solution.hpp"

#include <algorithm>
#include <cmath>

#include "urban_gnss_localization/geometry/angles.hpp"
#include "urban_gnss_localization/receivers/ground_velocity.hpp"

namespace urban_gnss {
namespace {

constexpr double kMetresPerSecondOfKnot = 1852.0 / 3600.0;
constexpr double kMostSigma_m = 100000.0;
enum PositionRank { kGga, kGns, kGll, kRmc };

double number_or_nan(std::string_view field) { return to_number(field).value_or(std::nan("")); }

double sigma_m(std::string_view field) {
  const double sigma = number_or_nan(field);
  return sigma > 0.0 && sigma <= kMostSigma_m ? sigma : std::nan("");
}

/// rad; NaN where it is none.
double course(std::string_view field) {
  const double degrees = number_or_nan(field);
  return degrees >= 0.0 && degrees <= 360.0 ? degrees_to_radians(degrees) : std::nan("");
}

/// Modes of NMEA 2.3 and later, the best first; 0 where the field has none.
char best_mode(std::string_view modes) {
  constexpr std::string_view kBestFirst = "RFPDAESMN";
  for (const char mode : kBestFirst) {
    if (modes.find(mode) != std::string_view::npos) return mode;
  }
  return 0;
}

}  // namespace

void NmeaSolution::add(const NmeaSentence& sentence) {
  has_status_ = has_status_ || is_about_position(sentence);
  if (sentence.type == "GGA") add_gga(sentence);
  if (sentence.type == "GNS") add_gns(sentence);
  if (sentence.type == "RMC") add_rmc(sentence);
  if (sentence.type == "GLL") add_gll(sentence);
  if (sentence.type == "GSA") add_gsa(sentence);
  if (sentence.type == "GST") add_gst(sentence);
  if (sentence.type == "VTG") add_vtg(sentence);
}

void NmeaSolution::set_position(int rank, const NmeaSentence& sentence, std::size_t at, double altitude_m) {
  const auto latitude = to_latitude_deg(sentence.field(at), sentence.field(at + 1));
  const auto longitude = to_longitude_deg(sentence.field(at + 2), sentence.field(at + 3));
  if (!latitude || !longitude || rank > position_rank_) return;
  position_rank_ = rank;
  position_ = {*latitude, *longitude, altitude_m};
}

/// m above the ellipsoid; NaN where it is not known.
double NmeaSolution::altitude(const NmeaSentence& sentence, std::size_t above_sea, std::size_t geoid) {
  const auto height = to_number(sentence.field(above_sea));
  if (!height) return kUnknown;
  const auto separation = to_number(sentence.field(geoid));
  lacks_geoid_ = !separation;
  return *height + separation.value_or(0.0);
}

void NmeaSolution::add_gga(const NmeaSentence& sentence) {
  const auto quality = to_count(sentence.field(5));
  if (quality) {
    quality_ = *quality;
    say(quality_ > 0);
  }
  hdop_ = number_or_nan(sentence.field(7));
  set_position(kGga, sentence, 1, altitude(sentence, 8, 10));
}

void NmeaSolution::add_gns(const NmeaSentence& sentence) {
  const char mode = best_mode(sentence.field(5));  // a letter for each system
  if (mode != 0) say(mode != 'N');
  if (mode_ == 0) mode_ = mode;
  if (!std::isfinite(hdop_)) hdop_ = number_or_nan(sentence.field(7));
  set_position(kGns, sentence, 1, altitude(sentence, 8, 9));
}

void NmeaSolution::add_rmc(const NmeaSentence& sentence) {
  const std::string_view status = sentence.field(1);
  const char mode = best_mode(sentence.field(11));
  if (status == "A" || status == "V") say(status == "A" && mode != 'N');
  if (mode != 0) mode_ = mode;
  set_position(kRmc, sentence, 2, kUnknown);
  rmc_speed_ = kMetresPerSecondOfKnot * number_or_nan(sentence.field(6));
  rmc_course_ = course(sentence.field(7));
}

void NmeaSolution::add_gll(const NmeaSentence& sentence) {
  const std::string_view status = sentence.field(5);
  const char mode = best_mode(sentence.field(6));
  if (status == "A" || status == "V") say(status == "A" && mode != 'N');
  if (mode_ == 0) mode_ = mode;
  set_position(kGll, sentence, 0, kUnknown);
}

void NmeaSolution::add_gsa(const NmeaSentence& sentence) {
  dimension_ = std::max(dimension_, to_count(sentence.field(1)).value_or(0));
  if (const auto hdop = to_number(sentence.field(15)); hdop && !std::isfinite(hdop_)) hdop_ = *hdop;
  if (const auto vdop = to_number(sentence.field(16))) vdop_ = *vdop;
}

void NmeaSolution::add_gst(const NmeaSentence& sentence) {
  const double major = sigma_m(sentence.field(2));
  const double minor = sigma_m(sentence.field(3));
  const double orientation =
      degrees_to_radians(number_or_nan(sentence.field(4)));  // of the major axis, from north to east
  const double north = sigma_m(sentence.field(5));
  const double east = sigma_m(sentence.field(6));
  const double up = sigma_m(sentence.field(7));

  const double trace = east * east + north * north;
  const double trace_of_ellipse = major * major + minor * minor;
  constexpr double kMostDisagreement = 1.5;  // some receivers give the ellipse for another confidence
  const bool ellipse_agrees =
      !(trace_of_ellipse > kMostDisagreement * trace) && !(trace > kMostDisagreement * trace_of_ellipse);
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  if (std::isfinite(orientation) && std::isfinite(trace_of_ellipse) && ellipse_agrees) {
    const Eigen::Vector2d along(std::sin(orientation), std::cos(orientation));
    const Eigen::Vector2d across(along.y(), -along.x());
    covariance.topLeftCorner<2, 2>() =
        major * major * along * along.transpose() + minor * minor * across * across.transpose();
  } else if (std::isfinite(trace)) {
    covariance(0, 0) = east * east;
    covariance(1, 1) = north * north;
  } else {
    return;
  }
  covariance(2, 2) = std::isfinite(up)
                         ? up * up
                         : kVerticalPerHorizontal * kVerticalPerHorizontal * covariance.topLeftCorner<2, 2>().trace();
  declared_ = covariance;
}

void NmeaSolution::add_vtg(const NmeaSentence& sentence) {
  vtg_course_ = course(sentence.field(0));
  // Before NMEA 2.3 the units' letters may be missing.
  const bool has_units = sentence.fields.size() >= 8;
  vtg_speed_ = kMetresPerSecondOfKnot * number_or_nan(sentence.field(has_units ? 4 : 2));
  if (!std::isfinite(vtg_speed_)) vtg_speed_ = number_or_nan(sentence.field(has_units ? 6 : 3)) / 3.6;
}

bool NmeaSolution::has_fix(const NmeaParameters& parameters) const {
  const bool is_measured = !is_reckoned() && !is_told() && (!is_simulated() || parameters.accept_simulated);
  return affirmed_ && !denied_ && is_measured && std::isfinite(position_.latitude_deg);
}

SolutionKind NmeaSolution::kind() const {
  if (quality_ == 4 || (quality_ == 0 && mode_ == 'R')) return SolutionKind::kRtkFixed;
  if (quality_ == 5 || (quality_ == 0 && mode_ == 'F')) return SolutionKind::kRtkFloat;
  if (quality_ == 2 || (quality_ == 0 && mode_ == 'D')) return SolutionKind::kDifferential;
  return SolutionKind::kStandalone;
}

RawFix NmeaSolution::fix(Stamp stamp, const NmeaParameters& parameters) const {
  RawFix fix;
  fix.stamp = stamp;
  fix.has_fix = has_fix(parameters);
  if (!fix.has_fix) {
    fix.position = {kUnknown, kUnknown, kUnknown};
    return fix;
  }
  fix.position = position_;
  if (dimension_ == 2) fix.position.altitude_m = kUnknown;
  if (!declared_ || !set_declared_covariance(*declared_, CovarianceType::kKnown, parameters.noise, fix)) {
    set_covariance_from_dop(hdop_, vdop_, kind(), parameters.noise, fix);
  }
  return fix;
}

std::optional<RawVelocity> NmeaSolution::velocity(Stamp stamp, const NmeaParameters& parameters) const {
  if (!has_fix(parameters)) return std::nullopt;
  const bool rmc_has_it = std::isfinite(rmc_speed_);
  const double speed = rmc_has_it ? rmc_speed_ : vtg_speed_;
  const double course = rmc_has_it ? rmc_course_ : vtg_course_;
  return ground_velocity(stamp, speed, course);
}

bool is_about_position(const NmeaSentence& sentence) {
  return sentence.type == "GGA" || sentence.type == "GNS" || sentence.type == "RMC" || sentence.type == "GLL";
}

std::optional<Stamp> time_of_day(const NmeaSentence& sentence) {
  const std::string& type = sentence.type;
  if (type == "GGA" || type == "GNS" || type == "RMC" || type == "GST" || type == "GRS" || type == "GBS" ||
      type == "ZDA") {
    return to_time_of_day(sentence.field(0));
  }
  if (type == "GLL") return to_time_of_day(sentence.field(4));
  return std::nullopt;
}

std::optional<Day> day_of(const NmeaSentence& sentence) {
  if (sentence.type == "RMC") return to_day(sentence.field(8));
  if (sentence.type != "ZDA") return std::nullopt;
  const auto day = to_count(sentence.field(1));
  const auto month = to_count(sentence.field(2));
  const auto year = to_count(sentence.field(3));
  return day && month && year ? to_day(*year, *month, *day) : std::nullopt;
}

}  // namespace urban_gnss
