#include "urban_gnss_localization/evaluation/track_report.hpp"

#include <algorithm>
#include <cmath>

#include "urban_gnss_localization/evaluation/report_json.hpp"

namespace urban_gnss {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr char kUnknown[] = "unknown";

/// Of stamps in ascending order.
std::vector<Gap> gaps_longer_than(const std::vector<Stamp>& stamps, Stamp limit) {
  std::vector<Gap> gaps;
  for (std::size_t i = 1; i < stamps.size(); ++i) {
    if (stamps[i] - stamps[i - 1] > limit) gaps.push_back({stamps[i - 1], stamps[i]});
  }
  return gaps;
}

double median_interval_s(const std::vector<Stamp>& stamps) {
  std::vector<double> intervals;
  for (std::size_t i = 1; i < stamps.size(); ++i) intervals.push_back(to_seconds(stamps[i] - stamps[i - 1]));
  return summarize(std::move(intervals)).median;
}

void remove_nans(std::vector<double>& values) {
  values.erase(std::remove_if(values.begin(), values.end(), [](double value) { return !std::isfinite(value); }),
               values.end());
}

bool was_used(const DecidedFix& fix) {
  return fix.outcome && fix.outcome->decision != FixDecision::kNotExamined && !is_rejected(fix.outcome->decision);
}

void summarize_fixes(const TrackReport& report, Stamp max_gap, TrackSummary& summary) {
  std::vector<Stamp> used;
  std::vector<double> nis;
  std::size_t compared = 0;
  std::size_t above = 0;
  summary.fixes = report.fixes.size();
  for (const DecidedFix& fix : report.fixes) {
    ++summary.decisions[fix.outcome ? to_string(fix.outcome->decision) : kUnknown];
    if (was_used(fix)) used.push_back(fix.stamp);
    if (!fix.outcome || !std::isfinite(fix.outcome->nis)) continue;
    nis.push_back(fix.outcome->nis);
    if (!std::isfinite(fix.outcome->nis_threshold)) continue;
    ++compared;
    if (fix.outcome->nis > fix.outcome->nis_threshold) ++above;
  }
  if (compared > 0) summary.nis_above_threshold = static_cast<double>(above) / static_cast<double>(compared);
  summary.nis = summarize(std::move(nis));
  const double interval_s = median_interval_s(used);
  if (std::isfinite(interval_s)) {
    summary.gaps_of_fixes = gaps_longer_than(used, std::max(max_gap, from_seconds(3.0 * interval_s)));
  }
}

void summarize_states(const TrackReport& report, TrackSummary& summary) {
  double healthy_s = 0.0;
  double all_s = 0.0;
  for (std::size_t i = 0; i < report.states.size(); ++i) {
    const StatedState& state = report.states[i];
    const Stamp end = i + 1 < report.states.size() ? report.states[i + 1].stamp
                      : report.estimate.empty()    ? state.stamp
                                                   : std::max(state.stamp, report.estimate.back().stamp);
    const double seconds = std::max(0.0, to_seconds(end - state.stamp));
    summary.seconds_in_state[state.state] += seconds;
    all_s += seconds;
    (state.healthy ? healthy_s : summary.seconds_not_healthy[state.reason]) += seconds;
  }
  if (all_s > 0.0) summary.healthy_share = healthy_s / all_s;
}

nlohmann::json to_json(const Summary& summary) {
  return {{"median", number_or_null(summary.median)},
          {"mean", number_or_null(summary.mean)},
          {"p95", number_or_null(summary.p95)},
          {"max", number_or_null(summary.max)}};
}

/// Thousandths are enough for a picture, and short.
nlohmann::json rounded(double value) { return number_or_null(std::round(1e3 * value) / 1e3); }

template <class Item, class Value>
nlohmann::json column(const std::vector<Item>& items, Value value, std::size_t step = 1) {
  nlohmann::json values = nlohmann::json::array();
  for (std::size_t i = 0; i < items.size(); i += step) values.push_back(value(items[i]));
  return values;
}

/// So that every `step`th of `count` are at most `most`.
std::size_t step_of(std::size_t count, std::size_t most) { return std::max<std::size_t>(1, (count + most - 1) / most); }

Stamp start_of(const TrackReport& report) {
  Stamp start = Stamp::max();
  if (!report.estimate.empty()) start = std::min(start, report.estimate.front().stamp);
  if (!report.fixes.empty()) start = std::min(start, report.fixes.front().stamp);
  if (!report.truth.empty()) start = std::min(start, report.truth.front().stamp);
  return start == Stamp::max() ? Stamp(0) : start;
}

nlohmann::json to_json(const std::vector<Gap>& gaps, Stamp start) {
  return column(gaps, [&](const Gap& gap) {
    return nlohmann::json::array({rounded(to_seconds(gap.begin - start)), rounded(to_seconds(gap.end - start))});
  });
}

/// The fixes with their decisions; what is unknown is null or empty.
nlohmann::json fixes_to_json(const TrackReport& report, Stamp start) {
  const auto& fixes = report.fixes;
  const auto of_outcome = [](auto value) {
    return [value](const DecidedFix& fix) { return rounded(fix.outcome ? value(*fix.outcome) : kNan); };
  };
  return {{"t", column(fixes, [&](const DecidedFix& fix) { return rounded(to_seconds(fix.stamp - start)); })},
          {"x", column(fixes, [](const DecidedFix& fix) { return rounded(fix.place.x()); })},
          {"y", column(fixes, [](const DecidedFix& fix) { return rounded(fix.place.y()); })},
          {"sigma", column(fixes, [](const DecidedFix& fix) { return rounded(fix.sigma_m); })},
          {"nis", column(fixes, of_outcome([](const FixOutcome& outcome) { return outcome.nis; }))},
          {"nis_threshold", column(fixes, of_outcome([](const FixOutcome& outcome) { return outcome.nis_threshold; }))},
          {"decision", column(fixes,
                              [](const DecidedFix& fix) -> std::string {
                                return fix.outcome ? to_string(fix.outcome->decision) : kUnknown;
                              })},
          {"reason", column(fixes, [](const DecidedFix& fix) { return fix.outcome ? fix.outcome->reason : ""; })}};
}

}  // namespace

TrackSummary summarize(const TrackReport& report, Stamp max_gap) {
  TrackSummary summary;
  summary.estimates = report.estimate.size();
  std::vector<Stamp> stamps;
  std::vector<double> sigmas;
  for (std::size_t i = 0; i < report.estimate.size(); ++i) {
    const TimedPose& pose = report.estimate[i];
    stamps.push_back(pose.stamp);
    sigmas.push_back(position_sigma_m(pose.covariance));
    if (i == 0 || pose.stamp - report.estimate[i - 1].stamp > max_gap) continue;
    const double step = (pose.pose.position() - report.estimate[i - 1].pose.position()).norm();
    if (std::isfinite(step)) summary.distance_m += step;
  }
  if (!stamps.empty()) summary.duration_s = to_seconds(stamps.back() - stamps.front());
  summary.gaps = gaps_longer_than(stamps, max_gap);
  remove_nans(sigmas);
  summary.sigma_m = summarize(std::move(sigmas));
  std::vector<double> speeds = report.speeds_mps;
  remove_nans(speeds);
  summary.speed_mps = summarize(std::move(speeds));
  summarize_fixes(report, max_gap, summary);
  summarize_states(report, summary);
  return summary;
}

nlohmann::json to_json(const TrackSummary& summary) {
  const auto longest = [](const std::vector<Gap>& gaps) {
    double seconds = 0.0;
    for (const Gap& gap : gaps) seconds = std::max(seconds, to_seconds(gap.end - gap.begin));
    return seconds;
  };
  return {{"estimates", summary.estimates},
          {"duration_s", summary.duration_s},
          {"distance_m", number_or_null(summary.distance_m)},
          {"sigma_m", to_json(summary.sigma_m)},
          {"speed_mps", to_json(summary.speed_mps)},
          {"gaps", summary.gaps.size()},
          {"longest_gap_s", longest(summary.gaps)},
          {"fixes", summary.fixes},
          {"decisions", summary.decisions},
          {"gaps_of_fixes", summary.gaps_of_fixes.size()},
          {"longest_gap_of_fixes_s", longest(summary.gaps_of_fixes)},
          {"nis", to_json(summary.nis)},
          {"nis_above_threshold", number_or_null(summary.nis_above_threshold)},
          {"seconds_in_state", summary.seconds_in_state},
          {"seconds_not_healthy", summary.seconds_not_healthy},
          {"healthy_share", number_or_null(summary.healthy_share)}};
}

nlohmann::json to_json(const TrackReport& report, const TrackSummary& summary, std::size_t most_points) {
  const Stamp start = start_of(report);
  const auto time_of = [&](const auto& item) { return rounded(to_seconds(item.stamp - start)); };
  const auto x_of = [](const TimedPose& pose) { return rounded(pose.pose.x); };
  const auto y_of = [](const TimedPose& pose) { return rounded(pose.pose.y); };
  const std::size_t step = step_of(report.estimate.size(), most_points);
  const std::size_t truth_step = step_of(report.truth.size(), most_points);
  const std::size_t error_step = step_of(report.errors.size(), most_points);
  const auto covariance = [&](int row, int col) {
    return column(
        report.estimate, [&](const TimedPose& pose) { return rounded(pose.covariance(row, col)); }, step);
  };
  const auto error_of = [](const ErrorSample& sample) { return rounded(sample.position_error_m); };
  nlohmann::json json = {
      {"name", report.name},
      {"fixes_without_position", report.fixes_without_position},
      {"localizer", report.localizer},
      {"start", to_seconds(start)},
      {"estimate",
       {{"t", column(report.estimate, time_of, step)},
        {"x", column(report.estimate, x_of, step)},
        {"y", column(report.estimate, y_of, step)},
        {"xx", covariance(0, 0)},
        {"xy", covariance(0, 1)},
        {"yy", covariance(1, 1)},
        {"sigma",
         column(
             report.estimate, [](const TimedPose& pose) { return rounded(position_sigma_m(pose.covariance)); }, step)},
        {"speed", column(report.speeds_mps, rounded, step)}}},
      {"fixes", fixes_to_json(report, start)},
      {"states",
       {{"t", column(report.states, time_of)},
        {"state", column(report.states, [](const StatedState& state) { return state.state; })},
        {"healthy", column(report.states, [](const StatedState& state) { return state.healthy; })},
        {"reason", column(report.states, [](const StatedState& state) { return state.reason; })}}},
      {"truth",
       {{"t", column(report.truth, time_of, truth_step)},
        {"x", column(report.truth, x_of, truth_step)},
        {"y", column(report.truth, y_of, truth_step)}}},
      {"errors",
       {{"t", column(report.errors, time_of, error_step)}, {"error", column(report.errors, error_of, error_step)}}},
      {"fix_errors", {{"t", column(report.fix_errors, time_of)}, {"error", column(report.fix_errors, error_of)}}},
      {"gaps", to_json(summary.gaps, start)},
      {"gaps_of_fixes", to_json(summary.gaps_of_fixes, start)}};
  if (report.map) {
    const GeodeticPosition& datum = report.map->datum();
    json["datum"] = {datum.latitude_deg, datum.longitude_deg, datum.altitude_m};
  }
  return json;
}

}  // namespace urban_gnss
