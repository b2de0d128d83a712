// Runs a bag through the same core as the live nodes.

#include "replay/replay.hpp"

int main(int argc, char** argv) { return urban_gnss::replay_main(argc, argv, urban_gnss::standard_localizers()); }
