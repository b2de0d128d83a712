#pragma once

#include <deque>
#include <optional>

#include "urban_gnss_localization/common/parameters.hpp"
#include "urban_gnss_localization/localizers/bias_estimate.hpp"

namespace urban_gnss {

/// How a fix waits for its bias.
struct BiasMatcherParameters {
  double bias_timeout{0.5};

  void visit(ParameterVisitor& v) {
    v("bias_timeout", bias_timeout, non_negative(), "s",
      "time, by the odometry's stamps, that a fix waits for its gps/bias; then the last radius is used");
  }
};

/// Pairs fixes with the biases that a bias filter found for them: the stamps are equal.
class BiasMatcher {
 public:
  /// Requires parameters without faults.
  explicit BiasMatcher(const BiasMatcherParameters& parameters) : parameters_(parameters) {}

  void add(const BiasEstimate& bias);

  /// Whether a fix should go on waiting for its bias, `waited_s` of odometry after it.
  bool awaits(Stamp fix, double waited_s) const;

  /// The bias of a fix, as its turn has come; nothing where it did not come in time.
  std::optional<BiasEstimate> take(Stamp fix);

  /// Radius (m) of the bias that was taken last; nothing before the first.
  std::optional<double> radius_m() const { return radius_m_; }
  void forget_radius() { radius_m_.reset(); }

  void reset() { *this = BiasMatcher(parameters_); }

 private:
  const BiasEstimate* find(Stamp fix) const;

  BiasMatcherParameters parameters_;
  std::deque<BiasEstimate> biases_;
  std::optional<double> radius_m_;
};

}  // namespace urban_gnss
