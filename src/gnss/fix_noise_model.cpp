#include "urban_gnss_localization/gnss/fix_noise_model.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "urban_gnss_localization/gnss/correlated_errors.hpp"

namespace urban_gnss {
namespace {

/// Weight of a fix in the mean of what fixes declare.
constexpr double kMeanRate = 0.03;
/// Between fixes that are remembered.
constexpr double kLeastWay_m = 1.0;
/// ln of the most by which a declared variance is changed: one that says "worth nothing" is still worth next to
/// nothing.
const double kMostTempered = std::log(4.0);

/// ln of the geometric mean of the variances along the ellipse's axes.
double log_variance(const Eigen::Matrix2d& covariance) { return 0.5 * std::log(covariance.determinant()); }

}  // namespace

DeadReckonedFix DeadReckonedTrack::beside(const Eigen::Vector2d& position, const Eigen::Matrix2d& covariance,
                                          const Eigen::Vector2d& antenna, double heading_sigma_rad,
                                          double position_walk, double time_s) const {
  DeadReckonedFix fix;
  fix.place = antenna - corrections_;
  fix.misfit = position - fix.place;
  fix.covariance = covariance;
  fix.walk_m2 = position_walk * position_walk * travel_.duration_s;
  fix.heading_sigma_rad = heading_sigma_rad;
  fix.time_s = time_s;
  fix.way_m = travel_.distance_m;
  return fix;
}

void FixNoiseModel::reset() {
  scale_ = fresh_scale();
  log_mean_variance_.reset();
  lagged_scale_.reset();
  fixes_.clear();
  last_s_.reset();
  since_fix_ = {};
}

void FixNoiseModel::move(const Twist2& twist, double duration_s) { since_fix_.add(twist, duration_s); }

Eigen::Matrix2d FixNoiseModel::effective_covariance(const Eigen::Matrix2d& declared) {
  const double now = log_variance(declared);
  if (!log_mean_variance_) log_mean_variance_ = now;
  *log_mean_variance_ += kMeanRate * (now - *log_mean_variance_);
  const double tempered = (1.0 - parameters_.fix_covariance_weight) * (now - *log_mean_variance_);
  return std::exp(-std::clamp(tempered, -kMostTempered, kMostTempered)) * declared;
}

double FixNoiseModel::correlation_inflation(double time_s) const {
  return last_s_ ? parameters_.errors.inflation(since_fix_.distance_m, time_s - *last_s_) : 1.0;
}

void FixNoiseModel::learn(double time_s, double exceeding) {
  scale_.learn(exceeding);
  last_s_ = time_s;
  since_fix_ = {};
}

void FixNoiseModel::compare(const DeadReckonedFix& fix) {
  if (parameters_.fix_scale_lag <= 0.0) return;
  const auto is_apart = [&](const DeadReckonedFix& before) {
    return fix.time_s - before.time_s >= parameters_.fix_scale_lag &&
           fix.way_m - before.way_m >= parameters_.fix_scale_distance;
  };
  while (fixes_.size() > 1 && is_apart(fixes_[1])) fixes_.pop_front();
  if (!fixes_.empty() && is_apart(fixes_.front())) {
    const DeadReckonedFix& before = fixes_.front();
    if (!lagged_scale_) lagged_scale_ = scale_;
    const double turned = (fix.place - before.place).norm() * std::max(fix.heading_sigma_rad, before.heading_sigma_rad);
    const Eigen::Matrix2d noise = lagged_scale_->value() * (fix.covariance + before.covariance);
    const double odometry_m2 = std::max(fix.walk_m2 - before.walk_m2, 0.0) + turned * turned;
    const Eigen::Matrix2d covariance = noise + odometry_m2 * Eigen::Matrix2d::Identity();
    const Eigen::Vector2d difference = fix.misfit - before.misfit;
    const double nis = difference.dot(covariance.inverse() * difference);
    lagged_scale_->learn(nis > LearntScale::kMedianNis ? 1.0 : 0.0, noise.trace() / covariance.trace());
  }
  // Who stands adds nothing: the fixes that are remembered do not grow in number.
  if (fixes_.empty() || fix.way_m - fixes_.back().way_m >= kLeastWay_m) fixes_.push_back(fix);
}

}  // namespace urban_gnss
