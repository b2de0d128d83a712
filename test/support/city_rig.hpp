#pragma once

#include <gtest/gtest.h>

#include <map>
#include <string>
#include <vector>

#include "package_directory.hpp"
#include "urban_gnss_localization/simulation/city_simulator.hpp"

namespace urban_gnss {

/// s from the start until the receiver has acquired its satellites; acquisition_time is 1 s.
inline constexpr double kAcquired_s = 1.3;

using Events = std::vector<SimulationEvent>;

inline Scenario scenario(const std::string& name, const std::vector<std::string>& overrides = {}) {
  return load_scenario(package_directory() + "/scenarios/" + name + ".yaml", overrides);
}

/// To the scenario's end.
inline Events run(CitySimulator& simulator) {
  Events events;
  while (!simulator.is_finished()) simulator.step(std::nullopt, events);
  return events;
}

inline Events run(const Scenario& scenario) {
  CitySimulator simulator(scenario);
  return run(simulator);
}

template <class Content>
struct Sample {
  double time_s;     ///< of the stamp, since the start
  double latency_s;  ///< until the publication
  const Content* content;
};

template <class Content>
std::vector<Sample<Content>> of(const Events& events, const Scenario& scenario) {
  std::vector<Sample<Content>> samples;
  for (const SimulationEvent& event : events) {
    const auto* content = std::get_if<Content>(&event.content);
    if (content == nullptr) continue;
    samples.push_back(
        {to_seconds(event.stamp - scenario.start_time), to_seconds(event.published - event.stamp), content});
  }
  return samples;
}

/// The receiver's own fixes.
inline std::map<Stamp, PublishedFix> own_fixes(const Events& events) {
  std::map<Stamp, PublishedFix> fixes;
  for (const SimulationEvent& event : events) {
    const auto* fix = std::get_if<FixEvent>(&event.content);
    if (fix != nullptr && fix->published.publisher == 0) fixes.emplace(event.stamp, fix->published);
  }
  return fixes;
}

/// Stamps ascend in each kind of event, publications over all.
inline void expect_ascending(const Events& events) {
  std::map<std::size_t, Stamp> last_of_kind;
  Stamp last{0};
  for (const SimulationEvent& event : events) {
    EXPECT_GE(event.published, event.stamp);
    EXPECT_GE(event.published, last);
    last = event.published;
    const auto* fix = std::get_if<FixEvent>(&event.content);
    const std::size_t kind =
        event.content.index() + (fix != nullptr ? 100u * static_cast<unsigned>(fix->published.publisher) : 0u);
    const auto before = last_of_kind.emplace(kind, Stamp(0)).first;
    EXPECT_GT(event.stamp, before->second) << "kind " << kind;
    before->second = event.stamp;
  }
}

}  // namespace urban_gnss
