#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "urban_gnss_localization/receivers/receiver_decoder.hpp"

namespace urban_gnss {

/// A topic of a driver.
struct ReceiverTopic {
  const char* name;   ///< below the driver's namespace
  const char* types;  ///< package/Type, several with commas between them
  ReceiverRole role;
  const char* use;  ///< for people: what is taken of it
};

/// What is known of a driver: the one place for it. receiver_node, replay and docs/receivers.md read it.
struct ReceiverPreset {
  std::string name;    ///< as in `receiver:=ublox`
  std::string driver;  ///< for people
  std::string ns;      ///< where its topics are, if nobody says otherwise
  std::vector<ReceiverTopic> topics;
  std::unique_ptr<ReceiverDecoder> (*make)();  ///< null where topics need only be remapped
};

const std::vector<ReceiverPreset>& receiver_presets();
/// Throws std::invalid_argument, which lists the names that there are.
const ReceiverPreset& find_receiver_preset(const std::string& name);
/// "gpsd, mavros, …".
std::string receiver_preset_names();

/// Whether a message of this type (package/Type) may be on the topic. The package is not compared: it was renamed in
/// several drivers, and the definition tells more.
bool is_type_of(const ReceiverTopic& topic, const std::string& type);

/// `ns`/name; the name alone where the namespace is empty, from the root where it is "/".
std::string full_name(const std::string& ns, const ReceiverTopic& topic);

/// The other way round: the namespace of a topic whose full name (without its leading slash) ends with the driver's,
/// "/" for the root; nothing where it ends otherwise.
std::optional<std::string> namespace_of(const std::string& full, const ReceiverTopic& topic);

/// Why a topic of this name must not be taken for a receiver's; empty where it may. mavros' `global_position/global`
/// and `local` are the autopilot's own estimate, of which a filter must not make a second one.
std::string why_not_a_receiver(const std::string& topic);

/// The presets as a table for people and scripts: receiver, driver, topic, types, what is taken; separated by tabs.
std::string describe_receiver_presets();

}  // namespace urban_gnss
