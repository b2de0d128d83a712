#include "urban_gnss_localization/receivers/gps_fix_reader.hpp"

#include <algorithm>
#include <cmath>

#include "urban_gnss_localization/common/positive_definite.hpp"
#include "urban_gnss_localization/geometry/angles.hpp"
#include "urban_gnss_localization/receivers/ground_velocity.hpp"
#include "urban_gnss_localization/receivers/message_parts.hpp"

namespace urban_gnss {
namespace {

constexpr double kRadius95 = 2.4477;  ///< standard deviations per axis, of the circle that holds 95 %
constexpr double kTwoSided95 = 1.96;

/// The number, where there is one that is positive; else 0.
double positive_or_zero(const MessageView& message, const char* field) {
  const double value = message.number_or(field, 0.0);
  return std::isfinite(value) && value > 0.0 ? value : 0.0;
}

bool declares_covariance(const RawFix& fix) {
  return fix.covariance_type != CovarianceType::kUnknown && fix.covariance.allFinite() &&
         is_positive_definite(Eigen::Matrix2d(fix.covariance.topLeftCorner<2, 2>()));
}

void take_covariance(const MessageView& message, RawFix& fix) {
  const std::vector<double> declared = message.numbers_if_any("position_covariance");
  if (declared.size() == 9 && message.has("position_covariance_type")) {
    fix.covariance = Eigen::Map<const Eigen::Matrix3d>(declared.data()).transpose();
    fix.covariance_type = covariance_type_of(message.integer("position_covariance_type"));
  }
  if (declares_covariance(fix)) return;
  fix.covariance.setZero();
  fix.covariance_type = CovarianceType::kUnknown;
  const double horizontal_m = positive_or_zero(message, "err_horz");
  const double sigma_m = (horizontal_m > 0.0 ? horizontal_m : positive_or_zero(message, "err")) / kRadius95;
  if (!(sigma_m > 0.0)) return;
  const double vertical_m = positive_or_zero(message, "err_vert") / kTwoSided95;
  const double up_m = vertical_m > 0.0 ? vertical_m : 2.0 * sigma_m;
  fix.covariance.diagonal() << sigma_m * sigma_m, sigma_m * sigma_m, up_m * up_m;
  fix.covariance_type = CovarianceType::kApproximated;
}

double at_or_unknown(const std::vector<double>& values, std::size_t index) {
  return index < values.size() ? values[index] : SatelliteObservation::kUnknown;
}

}  // namespace

RawFix gps_fix_of(const MessageView& message, Stamp stamp) {
  RawFix fix;
  fix.stamp = stamp;
  fix.position = {message.number("latitude"), message.number("longitude"), message.number("altitude")};
  fix.has_fix = !message.has("status.status") || message.integer("status.status") >= 0;
  take_covariance(message, fix);
  return fix;
}

std::optional<RawVelocity> gps_fix_velocity_of(const MessageView& message, Stamp stamp) {
  const double speed_mps = message.number("speed");
  const double track_deg = message.number("track");
  const double speed_sigma_mps = positive_or_zero(message, "err_speed") / kTwoSided95;
  if (speed_mps == 0.0 && track_deg == 0.0 && speed_sigma_mps == 0.0) return std::nullopt;
  const bool has_track = std::abs(track_deg) <= 360.0;
  const double track = has_track ? degrees_to_radians(track_deg) : SatelliteObservation::kUnknown;
  auto velocity = ground_velocity(stamp, speed_mps, track);
  if (!velocity || speed_sigma_mps == 0.0) return velocity;
  if (!has_track) {
    velocity->covariance += speed_sigma_mps * speed_sigma_mps * Eigen::Matrix2d::Identity();
    return velocity;
  }
  const Eigen::Vector2d along(std::sin(track), std::cos(track));
  const Eigen::Vector2d across(along.y(), -along.x());
  const double track_sigma = degrees_to_radians(positive_or_zero(message, "err_track")) / kTwoSided95;
  const double across_sigma_mps = std::max(speed_sigma_mps, speed_mps * std::min(track_sigma, 1.0));
  velocity->covariance = speed_sigma_mps * speed_sigma_mps * along * along.transpose() +
                         across_sigma_mps * across_sigma_mps * across * across.transpose();
  return velocity;
}

SatelliteEpoch gps_status_satellites_of(const MessageView& message, const std::string& prefix,
                                        std::optional<SatelliteId> (*satellite_of)(int number)) {
  const std::string visible = prefix + "satellite_visible_";
  const std::vector<double> numbers = message.numbers_if_any(visible + "prn");
  const std::vector<double> azimuths = message.numbers_if_any(visible + "azimuth");
  const std::vector<double> elevations =
      message.numbers_if_any(visible + (message.has(visible + "z") ? "z" : "elevation"));
  const std::vector<double> ratios = message.numbers_if_any(visible + "snr");
  SatelliteEpoch epoch;
  epoch.angle_resolution_rad = whole_degrees_rad();
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    const bool is_number = std::abs(numbers[i]) < 1e6;
    const auto id = is_number ? satellite_of(static_cast<int>(numbers[i])) : std::nullopt;
    if (!id) continue;
    SatelliteObservation observation;
    observation.id = *id;
    const double azimuth_deg = at_or_unknown(azimuths, i);
    const double elevation_deg = at_or_unknown(elevations, i);
    const bool is_unknown = azimuth_deg == 0.0 && elevation_deg == 0.0;
    observation.look = look_angles(azimuth_deg, is_unknown ? SatelliteObservation::kUnknown : elevation_deg);
    observation.cn0_dbhz = cn0_or_unknown(at_or_unknown(ratios, i));
    observation.tracked = has_cn0(observation);
    epoch.satellites.push_back(observation);
  }
  return epoch;
}

}  // namespace urban_gnss
