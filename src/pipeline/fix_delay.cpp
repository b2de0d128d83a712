#include "urban_gnss_localization/pipeline/fix_delay.hpp"

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <sstream>
#include <utility>

namespace urban_gnss {
namespace {

constexpr double kMostGiven_s = 5.0;
constexpr double kWindow_s = 60.0;
constexpr int kLeastVectors = 15;
constexpr int kLeastWindows = 2;
/// A window of which more than this share is left by the best fit says nothing.
constexpr double kMostLeft = 0.5;
/// Log-likelihood by which a delay must be better than none, and by which those of its range are worse at the most.
constexpr double kEvidence = 8.0;
constexpr double kRange = 4.0;
/// A shorter one is not worth a change.
constexpr double kLeastDelay_s = 0.15;
constexpr double kNewsworthy_s = 0.1;

/// Between fixes that are compared: their errors are alike, and the robot has moved.
constexpr double kLeastApart_s = 1.9;
constexpr double kMostApart_s = 4.0;
constexpr double kLeastWay_m = 1.0;

std::complex<double> to_complex(const Eigen::Vector2d& vector) { return {vector.x(), vector.y()}; }

/// The antenna's places by the odometry (m) at the stamp by each delay; nothing where the history does not reach as
/// far.
std::optional<DelaySearch::Vectors> places_at(Stamp stamp, const OdometryHistory& history,
                                              const Eigen::Vector2d& antenna) {
  DelaySearch::Vectors places;
  for (std::size_t i = 0; i < places.size(); ++i) {
    const auto pose = history.pose_at(stamp - from_seconds(DelaySearch::kStep_s * static_cast<double>(i)));
    if (!pose) return std::nullopt;
    places[i] = to_complex(transform_point(*pose, antenna));
  }
  return places;
}

/// The number that the whole text is; NaN where it is none.
double number_of(const std::string& text) {
  std::istringstream stream(text);
  double value = 0.0;
  return stream >> value && stream.eof() ? value : std::nan("");
}

}  // namespace

void FixDelayParameters::check(std::vector<std::string>& faults) const {
  if (is_auto()) return;
  const double value = number_of(fix_delay);
  if (!(value >= 0.0 && value <= kMostGiven_s)) {
    faults.push_back("fix_delay: is " + fix_delay + "; must be auto, or a number of seconds from 0 to 5");
  }
}

double FixDelayParameters::given_s() const {
  const double value = number_of(fix_delay);
  return std::isfinite(value) ? value : 0.0;
}

void DelaySearch::add(Stamp stamp, const std::complex<double>& measured, const Vectors& odometry) {
  if (window_.begin && to_seconds(stamp - *window_.begin) >= kWindow_s) close_window();
  if (!window_.begin) window_.begin = stamp;
  ++window_.count;
  window_.measured_square += std::norm(measured);
  for (std::size_t i = 0; i < kCandidates; ++i) {
    window_.odometry_square[i] += std::norm(odometry[i]);
    window_.product[i] += measured * std::conj(odometry[i]);
  }
}

void DelaySearch::close_window() {
  const Window window = std::exchange(window_, {});
  if (window.count < kLeastVectors) return;
  // What is left of the measured vectors once the odometry's, best turned and scaled, are taken off.
  std::array<double, kCandidates> left{};
  for (std::size_t i = 0; i < kCandidates; ++i) {
    const double explained = std::norm(window.product[i]) / std::max(window.odometry_square[i], 1e-9);
    left[i] = std::max(window.measured_square - explained, 1e-9 * window.measured_square);
  }
  const double least = *std::min_element(left.begin(), left.end());
  if (!(least > 0.0) || least > kMostLeft * window.measured_square) return;
  ++window_count_;
  for (std::size_t i = 0; i < kCandidates; ++i) log_likelihood_[i] -= 0.5 * window.count * std::log(left[i] / least);
}

std::optional<DelayEstimate> DelaySearch::estimate() const {
  const auto best = std::max_element(log_likelihood_.begin(), log_likelihood_.end());
  if (window_count_ < kLeastWindows || *best - log_likelihood_.front() < kEvidence) return std::nullopt;
  const auto is_likely = [&](double each) { return each >= *best - kRange; };
  const auto first = std::find_if(log_likelihood_.begin(), log_likelihood_.end(), is_likely);
  const auto last = std::find_if(log_likelihood_.rbegin(), log_likelihood_.rend(), is_likely);
  const auto seconds = [&](auto at) { return kStep_s * static_cast<double>(at - log_likelihood_.begin()); };
  DelayEstimate found;
  found.least_s = seconds(first);
  found.most_s = seconds(last.base() - 1);
  if (found.least_s < kLeastDelay_s) return std::nullopt;
  found.delay_s = seconds(best);
  if (best + 1 == log_likelihood_.end()) return found;
  // The peak of the parabola through the best and its neighbours.
  const double curvature = *(best - 1) - 2.0 * *best + *(best + 1);
  if (curvature < 0.0) found.delay_s += 0.5 * kStep_s * (*(best - 1) - *(best + 1)) / curvature;
  return found;
}

void FixDelayEstimator::add(Stamp stamp, const Eigen::Vector2d& position, const OdometryHistory& history,
                            const Eigen::Vector2d& antenna) {
  if (!parameters_.is_auto()) return;
  const double apart_s = last_ ? to_seconds(stamp - last_->stamp) : kMostApart_s;
  if (apart_s < kLeastApart_s) return;
  const auto places = places_at(stamp, history, antenna);
  if (places && last_ && apart_s < kMostApart_s) {
    DelaySearch::Vectors moved;
    for (std::size_t i = 0; i < moved.size(); ++i) moved[i] = (*places)[i] - last_->places[i];
    if (std::abs(moved.front()) > kLeastWay_m) {
      search_.add(stamp, to_complex(position - last_->position), moved);
      update();
    }
  }
  last_ = places ? std::optional<Fix>({stamp, position, *places}) : std::nullopt;
}

void FixDelayEstimator::forget_odometry() {
  search_.begin_window();
  last_.reset();
}

void FixDelayEstimator::update() {
  const auto found = search_.estimate();
  if (!found || std::abs(found->delay_s - delay_s_) < kNewsworthy_s) return;
  delay_s_ = found->delay_s;
  std::ostringstream text;
  text << std::fixed << std::setprecision(1) << "fixes come " << delay_s_ << " s late (" << found->least_s << " to "
       << found->most_s << " s by the motion): they are taken for where the robot was then";
  news_ = text.str();
}

std::optional<std::string> FixDelayEstimator::take_news() { return std::exchange(news_, std::nullopt); }

}  // namespace urban_gnss
