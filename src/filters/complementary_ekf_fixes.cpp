// What a fix is compared with, and going back to where a bias began.

#include <algorithm>
#include <cmath>

#include "urban_gnss_localization/filters/complementary_ekf.hpp"

namespace urban_gnss {
namespace {

/// A robot that moves less than this between two fixes stands.
constexpr double kParked_mps = 0.02;

}  // namespace

FixNoise ComplementaryEkf::noise_of_fix() const {
  return parameters_.mode == ComplementaryMode::kCompensated ? noise_monitor_.noise() : FixNoise{};
}

ComplementaryEkf::Innovation ComplementaryEkf::innovate(const FixMeasurement& fix) {
  const FixNoise noise = noise_of_fix();
  move_colour(fix, noise);
  const Eigen::Vector2d predicted = transform_point(pose_, fix.antenna_in_body);
  const Eigen::Vector2d lever = predicted - pose_.position();
  Innovation innovation;
  innovation.value = fix.position - predicted - colour_;
  innovation.observation.setZero();
  innovation.observation.leftCols<2>().setIdentity();
  innovation.observation.col(2) << -lever.y(), lever.x();
  innovation.observation.rightCols<2>().setIdentity();
  innovation.white = noise.white * fix.covariance;
  innovation.time_s = fix.time_s;
  return innovation;
}

void ComplementaryEkf::move_bias(double time_s) {
  const double elapsed_s = std::max(0.0, time_s - last_fix_s_);
  const double share = std::exp(-elapsed_s / parameters_.fix_bias_time);
  const double grown = parameters_.fix_bias_sigma * parameters_.fix_bias_sigma * (1.0 - share * share);
  filter_.fade_bias(share);
  filter_.grow_bias(grown * Eigen::Matrix2d::Identity());
}

void ComplementaryEkf::move_colour(const FixMeasurement& fix, const FixNoise& noise) {
  const bool is_parked = elapsed_since_fix_s_ > 0.0 && moved_since_fix_m_ < kParked_mps * elapsed_since_fix_s_;
  const double time_s = is_parked ? parameters_.parked_correlation_time : parameters_.fix_correlation_time;
  const double share = had_fix_ ? std::exp(-std::max(0.0, fix.time_s - last_fix_s_) / time_s) : 0.0;
  Filter::StateCovariance transition = Filter::StateCovariance::Identity();
  transition.bottomRightCorner<2, 2>() *= share;
  Filter::StateCovariance q = Filter::StateCovariance::Zero();
  q.bottomRightCorner<2, 2>() = (1.0 - share * share) * noise.coloured * fix.covariance;
  filter_.predict(transition * filter_.bias_free_state(), transition, q);
  colour_ *= share;
}

ComplementaryEkf::Snapshot ComplementaryEkf::snapshot() const {
  return {pose_, errors_, filter_, colour_, moved_since_fix_m_, elapsed_since_fix_s_, last_fix_s_, had_fix_};
}

void ComplementaryEkf::restore(const Snapshot& from) {
  pose_ = from.pose;
  errors_ = from.errors;
  filter_ = from.filter;
  colour_ = from.colour;
  moved_since_fix_m_ = from.moved_since_fix_m;
  elapsed_since_fix_s_ = from.elapsed_since_fix_s;
  last_fix_s_ = from.last_fix_s;
  had_fix_ = from.had_fix;
}

void ComplementaryEkf::remember(const FixMeasurement& fix) {
  if (is_open_ || heading_search_ || parameters_.mode != ComplementaryMode::kCompensated) {
    memory_.clear();
    return;
  }
  while (memory_.size() > 1 && fix.time_s - memory_[1].fix.time_s > parameters_.bias_onset_time) memory_.pop_front();
  memory_.push_back({fix, snapshot(), {}});
}

bool ComplementaryEkf::open_at_onset(double now_s, const Eigen::Matrix2d& m0) {
  while (memory_.size() > 1 && now_s - memory_.front().fix.time_s > parameters_.bias_onset_time) memory_.pop_front();
  if (is_open_ || memory_.empty()) {
    filter_.open_bias(m0);
    return false;
  }
  restore(memory_.front().after);
  filter_.open_bias(m0);
  for (std::size_t i = 0; i < memory_.size(); ++i) {
    for (const Step& each : memory_[i].steps) step(each.twist, each.duration_s);
    if (i + 1 == memory_.size()) break;
    const FixMeasurement& fix = memory_[i + 1].fix;
    move_bias(fix.time_s);
    apply(innovate(fix));
    last_fix_s_ = fix.time_s;
    moved_since_fix_m_ = 0.0;
    elapsed_since_fix_s_ = 0.0;
  }
  memory_.clear();
  return true;
}

}  // namespace urban_gnss
