#include "urban_gnss_localization/evaluation/statistics.hpp"

#include <algorithm>
#include <cmath>

namespace urban_gnss {

double percentile(const std::vector<double>& ascending, double percent) {
  if (ascending.empty()) return std::numeric_limits<double>::quiet_NaN();
  const double last = static_cast<double>(ascending.size() - 1);
  const double rank = std::clamp(percent / 100.0, 0.0, 1.0) * last;
  const auto below = static_cast<std::size_t>(rank);
  const std::size_t above = std::min(below + 1, ascending.size() - 1);
  return ascending[below] + (rank - static_cast<double>(below)) * (ascending[above] - ascending[below]);
}

Summary summarize(std::vector<double> sample) {
  Summary summary;
  summary.count = sample.size();
  if (sample.empty()) return summary;

  std::sort(sample.begin(), sample.end());
  const double count = static_cast<double>(sample.size());
  double sum = 0.0;
  double sum_of_squares = 0.0;
  for (const double value : sample) {
    sum += value;
    sum_of_squares += value * value;
  }
  summary.mean = sum / count;
  summary.rmse = std::sqrt(sum_of_squares / count);
  if (sample.size() > 1) {
    // About the mean in a second pass: the difference of the two sums above loses all digits for a small spread.
    double spread = 0.0;
    for (const double value : sample) spread += (value - summary.mean) * (value - summary.mean);
    summary.sigma = std::sqrt(spread / (count - 1.0));
  }
  summary.median = percentile(sample, 50.0);
  summary.p95 = percentile(sample, 95.0);
  summary.max = sample.back();
  return summary;
}

}  // namespace urban_gnss
