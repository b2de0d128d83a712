#pragma once

#include <Eigen/Core>
#include <array>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <vector>

#include "urban_gnss_localization/evaluation/statistics.hpp"
#include "urban_gnss_localization/simulation/simulator.hpp"

namespace urban_gnss {

/// Statistics of the satellites of one path class.
struct PathClassSummary {
  PathClass path_class{PathClass::kBlocked};
  std::size_t count{0};   ///< of satellites and epochs
  Summary range_error_m;  ///< signed; empty for blocked
  Summary absolute_range_error_m;
  Summary cn0_dbhz;
};

/// Statistics of a simulated receiver.
struct ReceiverSummary {
  std::size_t epochs{0};
  double availability{0.0};        ///< share of the epochs with a finite fix
  Summary error_m;                 ///< horizontal
  double correlation_time_s{0.0};  ///< of the horizontal error, see correlation_time(); NaN where it is not known
  Summary claimed_sigma_m;         ///< per axis; empty where the receiver declares no covariance
  double nees_mean{0.0};           ///< of the horizontal error against the claimed covariance; 2 where that is honest
  double used_mean{0.0};           ///< satellites in a fix
  std::array<PathClassSummary, 4> classes;
};

/// The lag at which the autocorrelation of a vector series, its mean taken off, first falls below 1/e, by linear
/// interpolation between lags. `interval_s` is the spacing of the samples; a gap in the series is an empty optional.
/// NaN where it never does, or for fewer than two samples.
double correlation_time(const std::vector<std::optional<Eigen::Vector2d>>& series, double interval_s);

/// Collects events and tells how the receiver did.
class SimulationStatistics {
 public:
  void add(const SimulationEvent& event);
  ReceiverSummary summary() const;

 private:
  struct Epoch {
    Stamp stamp{0};
    std::optional<Eigen::Vector2d> error;
    std::optional<double> claimed_variance_m2;
    int used{0};
  };
  std::vector<Epoch> epochs_;
  std::array<std::vector<double>, 4> range_errors_m_;  ///< by path class
  std::array<std::vector<double>, 4> cn0_dbhz_;
  std::array<std::size_t, 4> counts_{};
};

nlohmann::json to_json(const ReceiverSummary& summary);

}  // namespace urban_gnss
