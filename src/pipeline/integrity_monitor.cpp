#include "urban_gnss_localization/pipeline/integrity_monitor.hpp"

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <sstream>
#include <utility>
#include <vector>

#include "urban_gnss_localization/common/median.hpp"

namespace urban_gnss {
namespace {

constexpr std::size_t kLeastFixes = 3;
/// A contradiction ends where the offset is below this share of what begins one.
constexpr double kEnd = 2.0 / 3.0;

Eigen::Vector2d median_offset(const std::deque<FixMisfit>& fixes) {
  std::vector<double> east;
  std::vector<double> north;
  for (const FixMisfit& each : fixes) {
    east.push_back(each.offset.x());
    north.push_back(each.offset.y());
  }
  return {upper_median(std::move(east)), upper_median(std::move(north))};
}

Eigen::Matrix2d claim_of(const FixMisfit& fix) { return fix.fix_covariance + fix.estimate_covariance; }

/// m^2, of the fix whose claim is in the middle.
Eigen::Matrix2d median_claim(const std::deque<FixMisfit>& fixes) {
  std::vector<Eigen::Matrix2d> claims;
  for (const FixMisfit& each : fixes) claims.push_back(claim_of(each));
  const auto middle = claims.begin() + static_cast<std::ptrdiff_t>(claims.size() / 2);
  std::nth_element(claims.begin(), middle, claims.end(),
                   [](const Eigen::Matrix2d& a, const Eigen::Matrix2d& b) { return a.trace() < b.trace(); });
  return *middle;
}

}  // namespace

std::string describe(const Contradiction& contradiction) {
  std::ostringstream text;
  text << std::fixed << std::setprecision(1) << "the fixes are " << contradiction.offset.norm()
       << " m from the estimate in the median, where " << contradiction.sigma_m << " m are claimed";
  return text.str();
}

void IntegrityMonitor::add(const FixMisfit& misfit) {
  newest_ = misfit.stamp;
  window_.push_back(misfit);
  while (to_seconds(misfit.stamp - window_.front().stamp) > parameters_.integrity_window) window_.pop_front();
  judge(misfit.stamp);
}

void IntegrityMonitor::note_correction(const Eigen::Vector2d& moved) {
  if (!window_.empty()) window_.back().moved = moved;
  if (contradiction_) given_way_ += moved;
}

void IntegrityMonitor::judge(Stamp now) {
  const bool is_long = to_seconds(now - window_.front().stamp) >= 0.5 * parameters_.integrity_window;
  if (!is_unconfirmed_ && (window_.size() < kLeastFixes || !is_long)) return;
  const Eigen::Vector2d offset = median_offset(window_);
  // The errors of fixes last: all of the window together are worth little more than one.
  const Eigen::Matrix2d claimed = median_claim(window_);
  const double sigmas = std::sqrt(offset.dot(claimed.inverse() * offset));
  if (!std::isfinite(sigmas)) return;
  if (sigmas < kEnd * parameters_.integrity_limit) {
    if (contradiction_) end(now);
    is_unconfirmed_ = false;
    return;
  }
  if (!contradiction_ && sigmas <= parameters_.integrity_limit) return;
  if (!contradiction_) {
    contradiction_ = Contradiction{first_beyond(parameters_.integrity_limit), now, offset, 0.0};
    time_to_detect_s_ = to_seconds(now - contradiction_->since);
    time_to_recover_s_ = std::numeric_limits<double>::quiet_NaN();
    given_way_ *= std::sqrt(doubt_left());
    for (const FixMisfit& each : window_) given_way_ += each.moved;
  }
  contradiction_->offset = offset;
  contradiction_->sigma_m = std::sqrt(0.5 * claimed.trace());
  is_persistent_ = to_seconds(now - contradiction_->found) >= parameters_.contradiction_patience;
}

Stamp IntegrityMonitor::first_beyond(double sigmas) const {
  const auto first = std::find_if(window_.begin(), window_.end(), [&](const FixMisfit& each) {
    return each.offset.dot(claim_of(each).inverse() * each.offset) > sigmas * sigmas;
  });
  return first == window_.end() ? window_.back().stamp : first->stamp;
}

Eigen::Matrix2d IntegrityMonitor::covariance() const {
  Eigen::Matrix2d doubt = doubt_left() * given_way_ * given_way_.transpose();
  if (contradiction_) doubt += contradiction_->offset * contradiction_->offset.transpose();
  return doubt;
}

double IntegrityMonitor::doubt_left() const {
  return contradiction_ ? 1.0 : std::exp(-to_seconds(newest_ - given_way_at_) / parameters_.doubt_time);
}

void IntegrityMonitor::end(Stamp now) {
  if (contradiction_) time_to_recover_s_ = to_seconds(now - contradiction_->found);
  contradiction_.reset();
  is_persistent_ = false;
  given_way_at_ = now;
}

void IntegrityMonitor::restart(bool is_told, const Eigen::Vector2d& moved) {
  given_way_ = is_told ? Eigen::Vector2d::Zero() : Eigen::Vector2d(std::sqrt(doubt_left()) * given_way_ + moved);
  given_way_at_ = newest_;
  if (contradiction_) end(newest_);
  window_.clear();
  is_unconfirmed_ = is_told;
}

}  // namespace urban_gnss
