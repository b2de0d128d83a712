#include "urban_gnss_localization/motion/imu_heading.hpp"

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <sstream>

#include "urban_gnss_localization/geometry/angles.hpp"

namespace urban_gnss {
namespace {

/// Headings from fixes and motion share the fixes of a minute; those that are closer say little new.
constexpr double kInterval_s = 20.0;
constexpr std::size_t kFewest = 4;
constexpr std::size_t kMost = 12;
/// Beyond which people should know.
constexpr double kTurned_rad = 0.5;
constexpr double kWanders_rad = 0.5;

}  // namespace

EnumNames<ImuHeadingUse> enum_names(ImuHeadingUse) {
  return {{"none", ImuHeadingUse::kNone}, {"learnt", ImuHeadingUse::kLearnt}, {"absolute", ImuHeadingUse::kAbsolute}};
}

bool HeadingCalibration::is_due(Stamp stamp) const {
  return parameters_.is_used() &&
         (comparisons_.empty() || std::abs(to_seconds(stamp - comparisons_.back().stamp)) >= kInterval_s);
}

bool HeadingCalibration::is_known() const { return comparisons_.size() >= kFewest; }

bool HeadingCalibration::add(Stamp stamp, double difference_rad, double other_sigma_rad) {
  comparisons_.push_back({stamp, wrap_angle(difference_rad + parameters_.imu_heading_offset), other_sigma_rad});
  if (comparisons_.size() > kMost) comparisons_.pop_front();
  if (!is_known()) return false;
  const Scatter found = scatter();
  const ImuHeadingVerdict before = verdict_;
  verdict_ = found.spread_rad > kWanders_rad          ? ImuHeadingVerdict::kWanders
             : std::abs(found.mean_rad) > kTurned_rad ? ImuHeadingVerdict::kTurned
                                                      : ImuHeadingVerdict::kFits;
  return verdict_ != before;
}

HeadingCalibration::Scatter HeadingCalibration::scatter() const {
  Scatter scatter;
  if (comparisons_.empty()) return scatter;
  double sine = 0.0;
  double cosine = 0.0;
  for (const Comparison& each : comparisons_) {
    sine += std::sin(each.difference_rad);
    cosine += std::cos(each.difference_rad);
    scatter.other_variance_rad2 += each.other_sigma_rad * each.other_sigma_rad;
  }
  scatter.mean_rad = std::atan2(sine, cosine);
  double squares = 0.0;
  for (const Comparison& each : comparisons_) {
    squares += std::pow(angle_difference(each.difference_rad, scatter.mean_rad), 2);
  }
  const auto count = static_cast<double>(comparisons_.size());
  scatter.spread_rad = std::sqrt(squares / std::max(1.0, count - 1.0));
  scatter.other_variance_rad2 /= count;
  return scatter;
}

std::optional<HeadingSample> HeadingCalibration::calibrated(const HeadingSample& told) const {
  const bool is_learnt = parameters_.imu_heading == ImuHeadingUse::kLearnt;
  if (!parameters_.is_used() || (is_learnt && !is_known())) return std::nullopt;
  const Scatter found = scatter();
  // What is learnt is no better than the headings that it is learnt from, which may share their errors.
  const double systematic_rad2 = is_learnt ? found.other_variance_rad2 : found.mean_rad * found.mean_rad;
  const double claimed_rad = std::max(told.sigma_rad, parameters_.imu_heading_sigma);
  HeadingSample sample = told;
  sample.yaw_rad = wrap_angle(told.yaw_rad + parameters_.imu_heading_offset - (is_learnt ? found.mean_rad : 0.0));
  sample.sigma_rad = std::sqrt(claimed_rad * claimed_rad + found.spread_rad * found.spread_rad + systematic_rad2);
  return sample;
}

std::string HeadingCalibration::describe() const {
  if (verdict_ == ImuHeadingVerdict::kUnknown) return {};
  const Scatter found = scatter();
  std::ostringstream text;
  text << std::fixed << std::setprecision(0) << "the IMU's heading is " << radians_to_degrees(found.mean_rad)
       << " deg off, give or take " << radians_to_degrees(found.spread_rad);
  switch (verdict_) {
    case ImuHeadingVerdict::kUnknown:
    case ImuHeadingVerdict::kFits: break;
    case ImuHeadingVerdict::kTurned:
      text << (parameters_.imu_heading == ImuHeadingUse::kLearnt
                   ? ": allowed for; is it NED, or mounted otherwise than tf says?"
                   : ": is it NED, or mounted otherwise than tf says? Set imu_heading_offset, or imu_heading: learnt");
      break;
    case ImuHeadingVerdict::kWanders: text << ": it wanders, and has no say (steel near the magnetometer?)"; break;
  }
  return text.str();
}

}  // namespace urban_gnss
