#pragma once

#include <string>

namespace urban_gnss {

/// The main function of the node of the registry's localizer `name` (RegisteredLocalizerNode). It stands alone here, so
/// that a node's own file compiles in a second.
int run_localizer_node(int argc, char** argv, const std::string& name);

}  // namespace urban_gnss
