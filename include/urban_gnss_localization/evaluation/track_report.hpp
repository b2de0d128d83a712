#pragma once

#include <Eigen/Core>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "urban_gnss_localization/evaluation/statistics.hpp"
#include "urban_gnss_localization/evaluation/trajectory_errors.hpp"
#include "urban_gnss_localization/geometry/local_frame.hpp"
#include "urban_gnss_localization/gnss/fix_decision.hpp"

namespace urban_gnss {

/// A fix in the map frame, and what a localizer decided about it.
struct DecidedFix {
  Stamp stamp{0};
  Eigen::Vector2d place{Eigen::Vector2d::Zero()};            ///< m, east and north of the datum
  double sigma_m{std::numeric_limits<double>::quiet_NaN()};  ///< that it declares, of its worse direction
  std::optional<FixOutcome> outcome;                         ///< nothing where no status tells
};

/// What a localizer said of itself, from this stamp on.
struct StatedState {
  Stamp stamp{0};
  std::string state;  ///< "tracking", ...
  bool healthy{false};
  std::string reason;
};

/// A period without something.
struct Gap {
  Stamp begin{0};
  Stamp end{0};
};

/// One estimate of one drive, with all that can be shown without knowing the truth; and the truth where it is known.
struct TrackReport {
  std::string name;       ///< "<bag's stem>/<topic>"
  std::string localizer;  ///< "imm_ekf", ...; empty where no status tells
  std::optional<LocalFrame> map;
  Trajectory estimate;
  std::vector<double> speeds_mps;  ///< of the estimate's poses; NaN where none is known
  std::vector<DecidedFix> fixes;
  std::size_t fixes_without_position{0};  ///< what the receiver sent beside them
  std::vector<StatedState> states;
  Trajectory truth;
  std::vector<ErrorSample> errors;      ///< of the estimate
  std::vector<ErrorSample> fix_errors;  ///< of the fixes as they came
};

/// A report in a few numbers; NaN where there is nothing to count.
struct TrackSummary {
  std::size_t estimates{0};
  double duration_s{0.0};  ///< from the first estimate to the last
  double distance_m{0.0};  ///< along the estimate, over no gap
  Summary sigma_m;         ///< of the estimates' positions
  Summary speed_mps;
  std::vector<Gap> gaps;  ///< of the estimate
  std::size_t fixes{0};
  std::map<std::string, std::size_t> decisions;                          ///< by name; "unknown" where no status tells
  std::vector<Gap> gaps_of_fixes;                                        ///< without a fix that was used
  Summary nis;                                                           ///< of all fixes that have one
  double nis_above_threshold{std::numeric_limits<double>::quiet_NaN()};  ///< share (0 to 1)
  std::map<std::string, double> seconds_in_state;                        ///< by name
  std::map<std::string, double> seconds_not_healthy;                     ///< by the reason
  double healthy_share{std::numeric_limits<double>::quiet_NaN()};        ///< of the time since the first status, 0 to 1
};

/// Gaps are longer than `max_gap`; those between used fixes than three of their median intervals, too.
TrackSummary summarize(const TrackReport& report, Stamp max_gap);

/// The summary with its units in the names of the keys.
nlohmann::json to_json(const TrackSummary& summary);

/// All of it, for a page that draws it: times in s since `start` of the report, at most `most_points` of the estimate.
nlohmann::json to_json(const TrackReport& report, const TrackSummary& summary, std::size_t most_points);

}  // namespace urban_gnss
