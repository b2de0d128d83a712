#pragma once

#include <stdexcept>
#include <string>
#include <vector>

/// Readers of what comes from outside, as functions that take any bytes: for libFuzzer (dev/fuzz.sh), and for the test
/// that replays the corpus.
namespace urban_gnss::fuzz {

/// A reader has done what it must not do with any input.
class Fault : public std::logic_error {
 public:
  using std::logic_error::logic_error;
};

inline void require(bool holds, const std::string& what) {
  if (!holds) throw Fault(what);
}

/// run() returns, unless the reader is wrong. Its corpus is the folder test/fuzz/corpus/NAME.
struct Target {
  const char* name;
  void (*run)(const std::string& bytes);
};

void read_assignment(const std::string& bytes);
void read_bag(const std::string& bytes);
void read_buildings(const std::string& bytes);
void read_csv(const std::string& bytes);
void read_definition(const std::string& bytes);
void read_gpsd(const std::string& bytes);
void read_nmea(const std::string& bytes);
void read_parameters(const std::string& bytes);
void read_pcd(const std::string& bytes);
void read_receiver(const std::string& bytes);
void read_scenario(const std::string& bytes);
void read_track(const std::string& bytes);
void read_tum(const std::string& bytes);
void read_yuma(const std::string& bytes);

inline const std::vector<Target>& targets() {
  static const std::vector<Target> all = {{"assignment", read_assignment},
                                          {"bag", read_bag},
                                          {"buildings", read_buildings},
                                          {"csv", read_csv},
                                          {"definition", read_definition},
                                          {"gpsd", read_gpsd},
                                          {"nmea", read_nmea},
                                          {"parameters", read_parameters},
                                          {"pcd", read_pcd},
                                          {"receiver", read_receiver},
                                          {"scenario", read_scenario},
                                          {"track", read_track},
                                          {"tum", read_tum},
                                          {"yuma", read_yuma}};
  return all;
}

}  // namespace urban_gnss::fuzz
