#pragma once

#include "urban_gnss_localization/localizers/registry.hpp"

namespace urban_gnss {

/// The program `replay` with the localizers of a registry: runs a bag through one of them, offline, deterministic, as
/// fast as the machine can. Returns the exit status.
int replay_main(int argc, char** argv, const LocalizerRegistry& localizers);

}  // namespace urban_gnss
