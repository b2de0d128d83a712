#pragma once

#include <deque>
#include <optional>
#include <vector>

#include "urban_gnss_localization/common/parameters.hpp"
#include "urban_gnss_localization/gnss/satellite.hpp"

namespace urban_gnss {

struct ResidualCheckParameters {
  double residual_misfit_limit{1.5};

  void visit(ParameterVisitor& v) {
    v("residual_misfit_limit", residual_misfit_limit, positive(), "",
      "share of the residuals (gps/satellites) that another place of the antenna would explain, relative to what it "
      "explains of noise (1), beyond which they are of another position than the fix, and are not used");
  }
};

/// How far the residuals are from those of a least-squares solution. At such a solution the gradient H' W r is zero,
/// for the weights W of the receiver: no other place, height or clock explains any of them. The result is the share of
/// r' W r that H explains, divided by the share that it explains of white noise (unknowns / ranges): 0 at a solution,
/// about 1 for residuals that have nothing to do with this position, more where all of them come from another place.
/// A receiver does not tell its weights: of those in use (equal, by elevation, by C/N0, by both) the best one counts.
///
/// Nothing where fewer than 2 ranges more than unknowns are known: what is explained then says nothing.
std::optional<double> residual_misfit(const std::vector<SatelliteObservation>& satellites);

/// Whether a receiver's residuals are those of its fixes, by the median of its last 60 epochs, once there are 20.
/// Residuals of another place would move a fix by the difference. Those of a filtered fix are no solution's either, but
/// tell the ranges all the same if they are taken at the fix: simulated ones have 0.1 to 1.2, so the limit is above.
/// They are believed again below 2/3 of the limit. Residuals of another epoch, or of a place a few metres beside, are
/// not found.
class ResidualCheck {
 public:
  /// Requires parameters without faults.
  explicit ResidualCheck(const ResidualCheckParameters& parameters) : parameters_(parameters) {}

  /// Adds an epoch; one without enough residuals changes nothing.
  void add(const std::vector<SatelliteObservation>& satellites);
  /// True as long as nothing speaks against it.
  bool belong() const { return belong_; }
  void reset() { *this = ResidualCheck(parameters_); }

 private:
  ResidualCheckParameters parameters_;
  std::deque<double> misfits_;  ///< of the last epochs
  bool belong_{true};
};

}  // namespace urban_gnss
