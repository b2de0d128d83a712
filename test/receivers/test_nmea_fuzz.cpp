// Any bytes are taken: no crash, and nothing is given out that is not finite but what may be unknown.

#include <gtest/gtest.h>

#include <random>

#include "nmea_text.hpp"
#include "receiver_soundness.hpp"
#include "urban_gnss_localization/receivers/nmea_decoder.hpp"

namespace urban_gnss {
namespace {

using Random = std::mt19937;

const std::vector<std::string> kSeeds{"GNRMC,120000.00,A,3725.58362,N,12205.61915,W,0.028,65.13,070220,13.06,E,F,V",
                                      "GNGGA,120000.00,3725.58362,N,12205.61915,W,5,12,0.76,4.4,M,-30.0,M,0.0,2000",
                                      "GNGNS,120000.00,3725.58362,N,12205.61915,W,ANNA,05,1.3,156.9,8.3,,0000",
                                      "GNGLL,3725.58362,N,12205.61915,W,120000.00,A,D",
                                      "GNGST,120000.00,23,2.0,1.0,30.0,2.3,3.5,4.0",
                                      "GNGRS,120000.00,1,1.5,-2.5,,,,,,,,,,,1,1",
                                      "GNGSA,A,3,17,02,06,28,12,13,15,24,19,,,,1.48,0.76,1.27,1",
                                      "GPGSV,3,1,10,02,25,181,42,06,45,146,45,12,19,292,47,13,17,209,43,1",
                                      "PQGSV,1,1,02,28,08,040,,29,,,,0,4",
                                      "GNVTG,65.13,T,52.07,M,0.028,N,0.053,K,D",
                                      "GNZDA,120000.00,07,02,2020,00,00"};

const std::vector<std::string> kNasty{"",
                                      "-",
                                      ".",
                                      "-0",
                                      "9999999999999999999999",
                                      "1e308",
                                      "nan",
                                      "inf",
                                      "00.000000000000000001",
                                      "-999999",
                                      "999999.999",
                                      "240000",
                                      "235960.99",
                                      "\x01",
                                      "99.99",
                                      "A",
                                      "V",
                                      "N",
                                      "0"};

int upto(Random& random, std::size_t size) {
  return std::uniform_int_distribution<int>(0, static_cast<int>(size) - 1)(random);
}

/// Feeds lines to two decoders: by the sentences' time, and by arrivals.
class Decoders {
 public:
  void add(const std::string& line) {
    by_time_.add(line);
    arrival_ += Stamp(7'000'000);
    by_arrival_.add(line, arrival_);
    EXPECT_EQ(fault_of(by_time_.take()), "");
    EXPECT_EQ(fault_of(by_arrival_.take()), "");
  }
  void finish() {
    by_time_.finish();
    by_arrival_.finish();
    EXPECT_EQ(fault_of(by_time_.take()), "");
    EXPECT_EQ(fault_of(by_arrival_.take()), "");
  }
  std::size_t solutions() const { return by_time_.counts().solutions; }

 private:
  NmeaDecoder by_time_{NmeaParameters(), NmeaClock::near(Stamp(std::chrono::hours(24 * 18299 + 12)))};
  NmeaDecoder by_arrival_;
  Stamp arrival_{0};
};

TEST(NmeaFuzz, FieldsOfAnyContentWithARightChecksum) {
  Random random(1);
  Decoders decoders;
  for (int i = 0; i < 40000; ++i) {
    std::string body = kSeeds[static_cast<std::size_t>(upto(random, kSeeds.size()))];
    for (int change = upto(random, 4); change > 0; --change) {
      const std::size_t from = body.find(',', static_cast<std::size_t>(upto(random, body.size())));
      if (from == std::string::npos) continue;
      const std::size_t to = std::min(body.find(',', from + 1), body.size());
      body.replace(from + 1, to - from - 1, kNasty[static_cast<std::size_t>(upto(random, kNasty.size()))]);
    }
    if (upto(random, 10) == 0) body.resize(static_cast<std::size_t>(upto(random, body.size())));
    if (upto(random, 10) == 0) body += "," + kNasty[static_cast<std::size_t>(upto(random, kNasty.size()))];
    decoders.add(nmea(body));
  }
  decoders.finish();
  EXPECT_GT(decoders.solutions(), 1000U);
}

TEST(NmeaFuzz, BytesThatAreChangedOrCut) {
  Random random(2);
  Decoders decoders;
  for (int i = 0; i < 40000; ++i) {
    std::string line = nmea(kSeeds[static_cast<std::size_t>(upto(random, kSeeds.size()))]);
    for (int change = upto(random, 3); change > 0; --change) {
      line[static_cast<std::size_t>(upto(random, line.size()))] = static_cast<char>(upto(random, 256));
    }
    if (upto(random, 4) == 0) line.resize(static_cast<std::size_t>(upto(random, line.size())));
    decoders.add(line);
  }
  decoders.finish();
}

TEST(NmeaFuzz, NoiseAsALog) {
  Random random(3);
  std::string log;
  for (int i = 0; i < 200000; ++i) log.push_back(static_cast<char>(upto(random, 256)));
  for (int i = 0; i < 2000; ++i) log[static_cast<std::size_t>(upto(random, log.size()))] = '$';
  log.insert(1000, nmea(kSeeds[1]) + "\n");
  Decoders decoders;
  std::size_t bytes = 0;
  for (const std::string_view line : split_nmea_lines(log)) {
    bytes += line.size();
    decoders.add(std::string(line));
  }
  decoders.finish();
  EXPECT_LE(bytes, log.size());
  EXPECT_EQ(decoders.solutions(), 1U);
}

}  // namespace
}  // namespace urban_gnss
