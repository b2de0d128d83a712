#include "urban_gnss_localization/simulation/fix_faults.hpp"

#include <limits>
#include <utility>

namespace urban_gnss {
namespace {

Eigen::Vector3d vector3(const std::vector<double>& values) { return {values[0], values[1], values[2]}; }

}  // namespace

EnumNames<FixFaultType> enum_names(FixFaultType) {
  return {{"spike", FixFaultType::kSpike},        {"blackout", FixFaultType::kBlackout},
          {"decoy", FixFaultType::kDecoy},        {"ramp", FixFaultType::kRamp},
          {"freeze", FixFaultType::kFreeze},      {"nan", FixFaultType::kNan},
          {"duplicate", FixFaultType::kDuplicate}};
}

void FixFault::check(std::vector<std::string>& faults) const {
  if (offset.size() != 3) faults.push_back("offset: must be three numbers (east, north, up)");
  if (rate.size() != 3) faults.push_back("rate: must be three numbers (east, north, up)");
}

FixFaults::FixFaults(std::vector<FixFault> faults, std::uint64_t seed) {
  for (FixFault& fault : faults) {
    Script script{std::move(fault), make_engine(seed, scripts_.size()), std::nullopt, 0};
    if (script.fault.type == FixFaultType::kDuplicate) script.publisher = ++duplicate_count_;
    scripts_.push_back(std::move(script));
  }
}

void FixFaults::apply(double time_s, const std::optional<ReceiverFix>& fix, std::vector<PublishedFix>& published) {
  published.clear();
  published.push_back({0, fix.has_value(), fix.value_or(ReceiverFix{})});
  for (Script& script : scripts_) {
    const FixFault& fault = script.fault;
    if (time_s >= fault.start && time_s < fault.start + fault.duration) {
      apply(time_s, script, published);
    } else {
      script.frozen.reset();
    }
  }
  if (fix) last_ = fix;
}

void FixFaults::apply(double time_s, Script& script, std::vector<PublishedFix>& published) const {
  const FixFault& fault = script.fault;
  PublishedFix& own = published.front();
  const auto is_hit = [&] { return draw_uniform(script.engine) < fault.share; };
  switch (fault.type) {
    case FixFaultType::kSpike:
      if (is_hit()) own.fix.position += vector3(fault.offset);
      break;
    case FixFaultType::kBlackout: own = {0, false, {}}; break;
    case FixFaultType::kDecoy:
      own.fix.position += vector3(fault.offset);
      for (double& coordinate : own.fix.position) coordinate += fault.sigma * draw_normal(script.engine);
      break;
    case FixFaultType::kRamp: own.fix.position += (time_s - fault.start) * vector3(fault.rate); break;
    case FixFaultType::kFreeze:
      if (!script.frozen) script.frozen = last_ ? last_ : own.has_fix ? std::optional(own.fix) : std::nullopt;
      if (script.frozen) own = {0, true, *script.frozen};
      break;
    case FixFaultType::kNan:
      if (is_hit()) own.fix.position.setConstant(std::numeric_limits<double>::quiet_NaN());
      break;
    case FixFaultType::kDuplicate:
      published.push_back(own);
      published.back().publisher = script.publisher;
      published.back().fix.position += vector3(fault.offset);
      break;
  }
}

}  // namespace urban_gnss
