// The node of a localizer of the registry. CMakeLists.txt builds it once for each, with the name in LOCALIZER; a localizer
// whose node does more has a file of its own beside this folder.

#include "urban_gnss_localization/ros/run_localizer_node.hpp"

int main(int argc, char** argv) { return urban_gnss::run_localizer_node(argc, argv, LOCALIZER); }
