#include "urban_gnss_localization/localizers/switching/fix_statistics.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace urban_gnss {
namespace {

constexpr int kYaw = 2;

/// A fix of ranges tells its own covariance; what is learnt is how good ranges in line of sight are: the factor on the
/// square of middle_range_sigma_m().
FixNoiseModelParameters range_noise(const SwitchingModelParameters& p) {
  FixNoiseModelParameters noise = p.noise;
  const double middle_m = p.ranges.middle_range_sigma_m();
  noise.fix_scale_limit = p.ranges.range_sigma_max / middle_m;
  noise.first_fix_scale = std::pow(p.ranges.range_sigma / middle_m, 2);
  return noise;
}

}  // namespace

FixStatistics::FixStatistics(const SwitchingModelParameters& parameters)
    : parameters_(parameters),
      noise_(parameters.noise),
      range_noise_(range_noise(parameters)),
      reacquisition_(parameters.reacquisition),
      velocity_scale_(parameters.velocity.fresh_scale()) {}

void FixStatistics::reset() {
  noise_.reset();
  range_noise_.reset();
  reacquisition_.reset();
  nominal_cn0_.reset();
  of_ranges_ = false;
  velocity_scale_ = parameters_.velocity.fresh_scale();
  last_fix_s_.reset();
  last_velocity_s_.reset();
  track_ = {};
  common_variance_m2_ = 0.0;
}

void FixStatistics::move(const Twist2& twist, double duration_s) {
  track_.move(twist, duration_s);
  noise_.move(twist, duration_s);
  range_noise_.move(twist, duration_s);
}

double FixStatistics::elapsed_s(double time_s) const {
  return last_fix_s_ ? std::max(time_s - *last_fix_s_, 0.0) : track_.travel().duration_s;
}

double FixStatistics::range_sigma_m() const {
  if (parameters_.noise.fix_scale_rate == 0.0) return parameters_.ranges.range_sigma;
  return parameters_.ranges.middle_range_sigma_m() * std::sqrt(range_noise_.scale());
}

std::optional<RelativePlace> FixStatistics::place_by_ranges(const FixMeasurement& fix, const PoseEstimate& before) {
  if (!parameters_.ranges.use_ranges || fix.satellites.empty()) return std::nullopt;
  nominal_cn0_.add(fix.satellites, parameters_.ranges.nlos);
  const auto nominal_dbhz = nominal_cn0_.dbhz();
  if (!nominal_dbhz) return std::nullopt;
  RelativePlace known;
  known.offset = transform_point(before.pose, fix.antenna_in_body) - fix.position;
  known.covariance = before.covariance.topLeftCorner<2, 2>();
  RangeFixParameters ranges = parameters_.ranges;
  ranges.range_sigma = range_sigma_m();
  return range_fix(fix.satellites, *nominal_dbhz, known, ranges);
}

FixMeasurement FixStatistics::effective_fix(const FixMeasurement& fix, const PoseEstimate& before) {
  const auto place = place_by_ranges(fix, before);
  of_ranges_ = place.has_value();
  FixMeasurement effective;  // without its satellites, which have had their say
  effective.position = fix.position;
  if (place) effective.position += place->offset;
  effective.covariance = place ? place->covariance : noise_.effective_covariance(fix.covariance);
  effective.antenna_in_body = fix.antenna_in_body;
  effective.time_s = fix.time_s;
  effective.stamp = fix.stamp;
  return effective;
}

void FixStatistics::learn_velocity(double time_s, double exceeding, const Pose2& before, const Pose2& after) {
  velocity_scale_.learn(exceeding);
  last_velocity_s_ = time_s;
  track_.correct(before.position(), after.position());
}

void FixStatistics::learn_fix(double time_s, double exceeding) {
  (of_ranges_ ? range_noise_ : noise_).learn(time_s, exceeding);
  reacquisition_.add(time_s);
  last_fix_s_ = time_s;
}

void FixStatistics::compare_with_odometry(const FixMeasurement& fix, const PoseEstimate& before, const Pose2& after) {
  FixNoiseModel& noise = of_ranges_ ? range_noise_ : noise_;
  const Eigen::Matrix2d declared =
      of_ranges_ ? Eigen::Matrix2d(fix.covariance / noise.scale()) : parameters_.fix.direct_covariance(fix.covariance);
  noise.compare(track_.beside(fix.position, declared, transform_point(before.pose, fix.antenna_in_body),
                              std::sqrt(before.covariance(kYaw, kYaw)), parameters_.odometry.position_walk,
                              fix.time_s));
  track_.correct(before.pose.position(), after.position());
  const double declared_m2 = 0.5 * declared.trace();
  const CommonErrorParameters& common = parameters_.common_error;
  common_variance_m2_ =
      common.variance_m2(noise.scale() * declared_m2, declared_m2,
                         of_ranges_ ? parameters_.range_common_error_share : common.common_error_share);
}

}  // namespace urban_gnss
