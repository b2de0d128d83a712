#include "urban_gnss_localization/receivers/gpsd_decoder.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "urban_gnss_localization/geometry/angles.hpp"
#include "urban_gnss_localization/receivers/ground_velocity.hpp"

namespace urban_gnss {
namespace {

constexpr Stamp kSameTime = std::chrono::milliseconds(10);
constexpr Stamp kOneReport = std::chrono::milliseconds(500);  // reports without a time that are of one solution
constexpr double kSigmasOf95 = 1.959964;                      // of a normal error in one axis
constexpr double kSigmasOf95In2d = 2.447747;                  // sqrt of chi^2 with two degrees of freedom
constexpr std::size_t kMostPending = 100;
constexpr int kReckoned = 5;
constexpr int kSimulated = 8;

}  // namespace

void GpsdDecoder::add(std::string_view line, std::optional<Stamp> arrival) {
  const GpsdReport report = parse_gpsd_report(line);
  if (const auto* position = std::get_if<GpsdPosition>(&report)) {
    if (is_used(position->device)) take_position(*position, arrival);
  } else if (const auto* sky = std::get_if<GpsdSky>(&report)) {
    if (is_used(sky->device)) take_sky(*sky);
  } else if (const auto* errors = std::get_if<GpsdErrors>(&report)) {
    if (is_used(errors->device)) take_errors(*errors);
  } else if (const auto* version = std::get_if<GpsdVersion>(&report)) {
    release_ = version->release;
    if (version->protocol != 3) {
      warn_once("gpsd " + release_ + " has protocol " + std::to_string(version->protocol) +
                ", not 3: it may be misread");
    }
  } else if (const auto* devices = std::get_if<GpsdDevices>(&report)) {
    for (const auto& [path, driver] : devices->drivers) {
      if (!driver.empty()) drivers_[path] = driver;
    }
  } else if (const auto* error = std::get_if<GpsdError>(&report)) {
    warn_once("gpsd says: " + error->message);
  } else if (std::holds_alternative<GpsdUnreadable>(report)) {
    warn_once("a line of gpsd is no report: left out");
  }
}

ReceiverOutput GpsdDecoder::take() { return std::exchange(output_, {}); }

void GpsdDecoder::settle() {
  if (!open_) return;
  if (!open_->satellites_given_out) take_pending();
  give_out();
}

void GpsdDecoder::reset() {
  settle();
  open_.reset();
  pending_ = {};
  device_.clear();
  drivers_.clear();
  release_.clear();
  mode_ = 0;
}

bool GpsdDecoder::is_used(const std::string& device) {
  if (device_.empty()) device_ = parameters_.device.empty() ? device : parameters_.device;
  if (device.empty() || device == device_) return true;
  warn_once("gpsd has several devices: " + device_ + " is used, " + device + " is left out (parameter device)");
  return false;
}

bool GpsdDecoder::is_of_open(std::optional<Stamp> time) const {
  return open_ && time && open_->time && std::chrono::abs(*time - *open_->time) <= kSameTime;
}

void GpsdDecoder::take_position(const GpsdPosition& position, std::optional<Stamp> arrival) {
  mode_ = position.mode;
  bool joins = is_of_open(position.time);
  if (!position.time && open_ && !open_->is_given_out) {
    joins = !arrival || !open_->arrival || *arrival - *open_->arrival < kOneReport;
  }
  if (!joins) {
    if (open_) give_out();
    open_ = Solution();  // Clang 14 refuses emplace() of a class within that has defaults
    open_->time = position.time;
    open_->arrival = arrival;
  }
  take_pending();
  open_->position = position;
  if (!open_->position.time) open_->position.time = open_->time;
}

void GpsdDecoder::take_sky(const GpsdSky& sky) {
  if (is_of_open(sky.time)) {
    open_->sky.merge(sky);
  } else if (pending_.skies.size() < kMostPending) {
    pending_.skies.push_back(sky);
  }
}

void GpsdDecoder::take_errors(const GpsdErrors& errors) {
  if (is_of_open(errors.time)) {
    take_pending();
    open_->errors = errors;
  } else {
    pending_.errors = errors;
  }
}

/// What came since the last TPV, where it is of the open solution.
void GpsdDecoder::take_pending() {
  const Pending pending = std::exchange(pending_, {});
  for (const GpsdSky& sky : pending.skies) {
    if (!sky.time || !open_->time || is_of_open(sky.time)) open_->sky.merge(sky);
  }
  if (pending.errors && (!pending.errors->time || is_of_open(pending.errors->time))) open_->errors = pending.errors;
}

/// Of the open solution, what has not been given out.
void GpsdDecoder::give_out() {
  if (!open_->is_given_out) give_out_fix();
  if (!open_->satellites_given_out) give_out_satellites();
}

void GpsdDecoder::give_out_fix() {
  open_->is_given_out = true;
  const bool wants_utc = parameters_.stamps == GpsdStamps::kUtc || !open_->arrival;
  open_->stamp = wants_utc ? open_->time : open_->arrival;
  if (!open_->stamp) return;
  output_.fixes.push_back(fix());
  if (const auto measured = velocity()) output_.velocities.push_back(*measured);
  if (open_->position.status == kReckoned) warn_once("the receiver reckons its position (status 5): taken as no fix");
  if (open_->position.status == kSimulated && !parameters_.accept_simulated) {
    warn_once("the receiver simulates (status 8): taken as no fix; accept_simulated takes it");
  }
}

void GpsdDecoder::give_out_satellites() {
  if (!open_->stamp || !open_->sky.has_list) return;
  open_->satellites_given_out = true;
  SatelliteEpoch epoch;
  epoch.stamp = *open_->stamp;
  epoch.angle_resolution_rad = open_->sky.has_whole_degrees ? degrees_to_radians(1.0) : 0.0;
  for (const auto& [id, each] : open_->sky.satellites) epoch.satellites.push_back(each.satellite);
  output_.satellites.push_back(std::move(epoch));
}

bool GpsdDecoder::comes_from_ublox() const {
  const auto driver = drivers_.find(device_);
  return driver != drivers_.end() && driver->second == "u-blox";
}

RawFix GpsdDecoder::fix() const {
  const GpsdPosition& position = open_->position;
  RawFix fix;
  fix.stamp = *open_->stamp;
  const bool is_measured =
      position.status != kReckoned && (position.status != kSimulated || parameters_.accept_simulated);
  fix.has_fix = position.mode >= 2 && is_measured && std::isfinite(position.latitude_deg) &&
                std::isfinite(position.longitude_deg);
  fix.position = {kGpsdUnknown, kGpsdUnknown, kGpsdUnknown};
  if (!fix.has_fix) return fix;
  fix.position = {position.latitude_deg, position.longitude_deg,
                  position.mode >= 3 ? position.altitude_m : kGpsdUnknown};
  set_covariance(fix);
  return fix;
}

void GpsdDecoder::set_covariance(RawFix& fix) const {
  const auto declare = [&](double east, double north, double up, CovarianceType type) {
    if (!std::isfinite(up)) up = kVerticalPerHorizontal * std::hypot(east, north);
    const Eigen::Vector3d sigma(east, north, up);
    return set_declared_covariance(sigma.cwiseAbs2().asDiagonal(), type, parameters_.noise, fix);
  };
  const GpsdPosition& position = open_->position;
  if (open_->errors) {
    const GpsdErrors& errors = *open_->errors;
    if (declare(errors.east_m, errors.north_m, errors.up_m, CovarianceType::kKnown)) return;
  }
  if (comes_from_ublox()) {
    const double horizontal = position.eph_m / std::sqrt(2.0);
    if (declare(horizontal, horizontal, position.epv_m, CovarianceType::kApproximated)) return;
  }
  const double up = position.epv_m / kSigmasOf95;
  if (declare(position.epx_m / kSigmasOf95, position.epy_m / kSigmasOf95, up, CovarianceType::kApproximated)) return;
  const double horizontal = position.eph_m / kSigmasOf95In2d;
  if (declare(horizontal, horizontal, up, CovarianceType::kApproximated)) return;
  SolutionKind kind = SolutionKind::kStandalone;
  if (position.status == 2) kind = SolutionKind::kDifferential;
  if (position.status == 3) kind = SolutionKind::kRtkFixed;
  if (position.status == 4) kind = SolutionKind::kRtkFloat;
  set_covariance_from_dop(open_->sky.hdop, open_->sky.vdop, kind, parameters_.noise, fix);
}

std::optional<RawVelocity> GpsdDecoder::velocity() const {
  if (!fix().has_fix) return std::nullopt;
  const GpsdPosition& position = open_->position;
  auto velocity = ground_velocity(*open_->stamp, position.speed_mps, position.course_rad);
  if (velocity && comes_from_ublox() && std::isfinite(position.eps_mps) && std::isfinite(position.course_rad)) {
    constexpr double kLeastSigma_mps = 0.05;
    const double sigma = std::max(position.eps_mps, kLeastSigma_mps);
    velocity->covariance = sigma * sigma * Eigen::Matrix2d::Identity();
  }
  return velocity;
}

void GpsdDecoder::warn_once(const std::string& warning) {
  if (said_.insert(warning).second) output_.warnings.push_back(warning);
}

}  // namespace urban_gnss
