#pragma once

#include <algorithm>
#include <cmath>
#include <optional>

#include "urban_gnss_localization/common/parameters.hpp"

namespace urban_gnss {

/// What is believed of the first fixes after a gap: those of a receiver that comes out of a door or a canyon are often
/// off by tens of metres, and do not say so.
struct ReacquisitionParameters {
  double reacquisition_gap{30.0};
  double reacquisition_sigma{20.0};
  double reacquisition_time{2.0};

  void visit(ParameterVisitor& v) {
    v("reacquisition_gap", reacquisition_gap, positive(), "s",
      "time without a fix after which the next ones may be off by reacquisition_sigma");
    v("reacquisition_sigma", reacquisition_sigma, non_negative(), "m per axis",
      "standard deviation that is added to that of the first fix after a gap; 0: none");
    v("reacquisition_time", reacquisition_time, positive(), "s",
      "time constant at which what is added to the following fixes decays");
  }
};

/// Tells by how much a fix may be worse since the receiver had none for a while.
class Reacquisition {
 public:
  /// Requires parameters without faults.
  explicit Reacquisition(const ReacquisitionParameters& parameters) : parameters_(parameters) {}

  /// m^2 per axis, beside the variance of a fix at `time_s`.
  double variance_m2(double time_s) const {
    const auto since_s = is_first(time_s) ? std::optional<double>(time_s) : regained_s_;
    if (!since_s) return 0.0;
    const double sigma_m =
        parameters_.reacquisition_sigma * std::exp(-std::max(time_s - *since_s, 0.0) / parameters_.reacquisition_time);
    return sigma_m * sigma_m;
  }
  /// A fix came; times ascend.
  void add(double time_s) {
    if (is_first(time_s)) regained_s_ = time_s;
    last_s_ = time_s;
  }
  void reset() { *this = Reacquisition(parameters_); }

 private:
  bool is_first(double time_s) const { return last_s_ && time_s - *last_s_ > parameters_.reacquisition_gap; }

  ReacquisitionParameters parameters_;
  std::optional<double> last_s_;      ///< of all fixes
  std::optional<double> regained_s_;  ///< the first fix after the last gap
};

}  // namespace urban_gnss
