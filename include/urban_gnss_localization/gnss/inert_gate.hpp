#pragma once

#include <deque>

#include "urban_gnss_localization/common/parameters.hpp"

namespace urban_gnss {

/// When a gate is said to be inert.
struct InertGateParameters {
  int inert_window{30};
  double inert_probability{1e-4};

  void visit(ParameterVisitor& v) {
    v("inert_window", inert_window, between(1, 10000), "", "number of fixes examined for the \"gate inert\" warning");
    v("inert_probability", inert_probability, between(1e-9, 0.1), "",
      "probability that a gate that works is reported as inert");
  }
};

/// Finds out whether a gate can find anything. A receiver may declare 5 m while its fixes scatter by centimetres: then
/// every fix passes. The gate is inert where the NIS of the last `inert_window` fixes add up to less than the
/// chi-squared quantile at `inert_probability`.
class InertGate {
 public:
  /// Requires parameters without faults.
  explicit InertGate(const InertGateParameters& parameters);

  /// Takes the NIS of one fix without a bias, with 2 degrees of freedom.
  void add(double nis);
  bool is_inert() const;
  void reset() { recent_nis_.clear(); }

 private:
  InertGateParameters parameters_;
  double threshold_;
  std::deque<double> recent_nis_;
};

}  // namespace urban_gnss
