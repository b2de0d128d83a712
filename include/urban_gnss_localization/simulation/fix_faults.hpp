#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "urban_gnss_localization/common/parameters.hpp"
#include "urban_gnss_localization/common/random.hpp"
#include "urban_gnss_localization/simulation/receiver.hpp"

namespace urban_gnss {

enum class FixFaultType {
  kSpike,      ///< single fixes are off by `offset`
  kBlackout,   ///< no fix
  kDecoy,      ///< fixes agree on a wrong place: `offset` and noise of `sigma`
  kRamp,       ///< the fix drifts away with `rate`
  kFreeze,     ///< the position (and velocity) before the fault is repeated with new stamps
  kNan,        ///< latitude, longitude and altitude are NaN, with the status of a fix
  kDuplicate,  ///< a second publisher: each fix again, off by `offset`, in another frame
};
EnumNames<FixFaultType> enum_names(FixFaultType);

/// A fault at a scripted time: active at start <= t < start + duration.
struct FixFault {
  FixFaultType type{FixFaultType::kSpike};
  double start{0.0};
  double duration{1.0};
  double share{1.0};
  std::vector<double> offset{0.0, 0.0, 0.0};
  std::vector<double> rate{0.0, 0.0, 0.0};
  double sigma{0.5};

  void visit(ParameterVisitor& v) {
    v("type", type, "");
    v("start", start, non_negative(), "", "s since the start of the simulation");
    v("duration", duration, positive(), "", "s");
    v("share", share, between(0.0, 1.0), "", "of the fixes in that time that are hit, drawn at random (spike, nan)");
    v("offset", offset, "m", "east, north, up (spike, decoy, duplicate)");
    v("rate", rate, "m/s", "east, north, up (ramp)");
    v("sigma", sigma, non_negative(), "", "m per axis (decoy)");
  }
  void check(std::vector<std::string>& faults) const;
};

/// A fix on its way to the topic.
struct PublishedFix {
  int publisher{0};    ///< 0 is the receiver; k > 0 the k-th kDuplicate of the script
  bool has_fix{true};  ///< where not, what `fix` holds says nothing
  ReceiverFix fix;     ///< the position may be NaN
};

/// Puts scripted faults on a receiver's fixes, in the order of the script where several are active.
class FixFaults {
 public:
  /// Requires faults without faults of their own (check()).
  FixFaults(std::vector<FixFault> faults, std::uint64_t seed);

  /// What is published at `time_s` (since the start of the simulation, not falling) instead of `fix`. Clears
  /// `published` first; its first element is the receiver's own.
  void apply(double time_s, const std::optional<ReceiverFix>& fix, std::vector<PublishedFix>& published);

 private:
  struct Script {
    FixFault fault;
    RandomEngine engine;                ///< of its own, so that no fault changes another's noise
    std::optional<ReceiverFix> frozen;  ///< kFreeze, while it is active
    int publisher;                      ///< kDuplicate
  };
  void apply(double time_s, Script& script, std::vector<PublishedFix>& published) const;

  std::vector<Script> scripts_;
  int duplicate_count_{0};
  std::optional<ReceiverFix> last_;  ///< the receiver's last fix, before faults
};

}  // namespace urban_gnss
