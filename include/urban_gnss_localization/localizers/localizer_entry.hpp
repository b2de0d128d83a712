#pragma once

#include <functional>
#include <memory>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "urban_gnss_localization/common/parameters.hpp"
#include "urban_gnss_localization/localizers/localizer.hpp"
#include "urban_gnss_localization/localizers/particle_localizer.hpp"
#include "urban_gnss_localization/motion/motion_model.hpp"

namespace urban_gnss {

/// The parameters of one localizer, and how it is made of them.
class LocalizerSettings {
 public:
  virtual ~LocalizerSettings() = default;

  virtual void visit(ParameterVisitor& v) = 0;
  /// Requires parameters without faults.
  virtual std::unique_ptr<Localizer> make() const = 0;
};

/// Settings of a localizer L that is made of its own parameters P and of the motion's noise.
template <class L, class P>
class SettingsWithMotion : public LocalizerSettings {
 public:
  using Made = L;

  void visit(ParameterVisitor& v) override { WithMotion<P>{filter_, motion_}.visit(v); }
  std::unique_ptr<Localizer> make() const override { return std::make_unique<L>(filter_, motion_); }

 private:
  P filter_;
  MotionParameters motion_;
};

/// How a localizer takes part in comparisons: with some parameters set, under a name of its own.
struct LocalizerVariant {
  std::string name;                      ///< "gated_ekf"
  std::vector<std::string> assignments;  ///< "mode=gated", as --set takes them
  bool with_occlusion{false};            ///< also behind the occlusion node
  bool on_request{false};                ///< only where it is named, as what a paper prints
};

/// What nodes, replay, experiments, reports, launch files and documents know of a localizer.
struct LocalizerEntry {
  std::string name;     ///< of its node (name_node), its YAML (config/name.yaml) and its section in a user's file
  std::string summary;  ///< one sentence
  std::function<std::unique_ptr<LocalizerSettings>()> settings;  ///< the defaults
  std::vector<LocalizerVariant> variants;
  /// The parameters that several localizers share are in one file, config/shared_parameters.yaml; empty: it shares
  /// none.
  std::string shared_parameters{};
  bool has_particles{false};  ///< it is a ParticleLocalizer
};

/// The entry of the localizer Settings::Made, whose LocalizerSettings are Settings.
template <class Settings>
LocalizerEntry make_entry(std::string name, std::string summary, std::vector<LocalizerVariant> variants,
                          std::string shared_parameters = "") {
  LocalizerEntry entry{std::move(name), std::move(summary), std::make_unique<Settings>, std::move(variants),
                       std::move(shared_parameters)};
  entry.has_particles = std::is_base_of_v<ParticleLocalizer, typename Settings::Made>;
  return entry;
}

}  // namespace urban_gnss
