#include "urban_gnss_localization/pipeline/rate_monitor.hpp"

#include <algorithm>
#include <sstream>
#include <vector>

#include "urban_gnss_localization/common/median.hpp"

namespace urban_gnss {
namespace {

constexpr std::size_t kStamps = 17;
constexpr double kChange = 1.5;  ///< factor
constexpr double kMost = 0.75;   ///< share of the intervals

}  // namespace

std::string RateMonitor::add(Stamp stamp) {
  stamps_.push_back(stamp);
  if (stamps_.size() < kStamps) return {};
  // Over two messages: those of two sources may come in pairs.
  std::vector<double> intervals_s;
  for (std::size_t i = 2; i < kStamps; ++i) intervals_s.push_back(0.5 * to_seconds(stamps_[i] - stamps_[i - 2]));
  stamps_.pop_front();
  const double now_s = upper_median(intervals_s);
  const double before_s = interval_s_.value_or(now_s);
  if (!interval_s_) interval_s_ = now_s;
  const auto share = [&](const auto& is_so) {
    return static_cast<double>(std::count_if(intervals_s.begin(), intervals_s.end(), is_so)) / (kStamps - 2);
  };
  const double shorter = share([&](double each_s) { return before_s > kChange * each_s; });
  const double longer = share([&](double each_s) { return each_s > kChange * before_s; });
  if (std::max(shorter, longer) < kMost) return {};
  interval_s_ = now_s;
  stamps_.clear();
  std::ostringstream text;
  text.precision(2);
  text << 1.0 / now_s << " Hz, " << 1.0 / before_s << " Hz before";
  return text.str();
}

}  // namespace urban_gnss
