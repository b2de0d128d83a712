#include "urban_gnss_localization/gnss/inert_gate.hpp"

#include <numeric>

#include "urban_gnss_localization/gnss/chi_squared.hpp"

namespace urban_gnss {

InertGate::InertGate(const InertGateParameters& parameters)
    : parameters_(parameters),
      threshold_(chi_squared_quantile(parameters.inert_probability, kFixDof * parameters.inert_window)) {}

void InertGate::add(double nis) {
  recent_nis_.push_back(nis);
  if (recent_nis_.size() > static_cast<std::size_t>(parameters_.inert_window)) recent_nis_.pop_front();
}

bool InertGate::is_inert() const {
  return recent_nis_.size() == static_cast<std::size_t>(parameters_.inert_window) &&
         std::accumulate(recent_nis_.begin(), recent_nis_.end(), 0.0) < threshold_;
}

}  // namespace urban_gnss
