#include "urban_gnss_localization/pipeline/rate_monitor.hpp"

#include <sstream>
#include <vector>

#include "urban_gnss_localization/common/median.hpp"

namespace urban_gnss {
namespace {

constexpr std::size_t kStamps = 17;
constexpr double kChange = 1.5;  ///< factor

}  // namespace

std::string RateMonitor::add(Stamp stamp) {
  stamps_.push_back(stamp);
  if (stamps_.size() < kStamps) return {};
  // Over two messages: those of two sources may come in pairs.
  std::vector<double> intervals_s;
  for (std::size_t i = 2; i < kStamps; ++i) intervals_s.push_back(0.5 * to_seconds(stamps_[i] - stamps_[i - 2]));
  stamps_.pop_front();
  const double now_s = upper_median(std::move(intervals_s));
  const double before_s = interval_s_.value_or(now_s);
  const bool has_changed = now_s > kChange * before_s || before_s > kChange * now_s;
  if (!interval_s_ || has_changed) interval_s_ = now_s;
  if (!has_changed) return {};
  stamps_.clear();
  std::ostringstream text;
  text.precision(2);
  text << 1.0 / now_s << " Hz, " << 1.0 / before_s << " Hz before";
  return text.str();
}

}  // namespace urban_gnss
