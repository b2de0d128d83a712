#include <gmock/gmock.h>

#include "nmea_text.hpp"
#include "urban_gnss_localization/receivers/nmea_fields.hpp"
#include "urban_gnss_localization/receivers/nmea_sentence.hpp"

namespace urban_gnss {
namespace {

using namespace std::chrono_literals;
using testing::ElementsAre;
using testing::Optional;

TEST(NmeaSentence, HasTalkerTypeAndFields) {
  const auto parsing = parse_nmea_sentence("$GPGLL,5251.0093,N,00518.8170,E,094736,A,A*43\r\n");
  ASSERT_TRUE(parsing.sentence);
  EXPECT_EQ(parsing.sentence->talker, "GP");
  EXPECT_EQ(parsing.sentence->type, "GLL");
  EXPECT_THAT(parsing.sentence->fields, ElementsAre("5251.0093", "N", "00518.8170", "E", "094736", "A", "A"));
  EXPECT_EQ(parsing.sentence->field(6), "A");
  EXPECT_EQ(parsing.sentence->field(7), "");
}

TEST(NmeaSentence, EmptyFieldsAreKept) {
  EXPECT_THAT(parse_nmea_sentence(nmea("GPRMC,,V,,")).sentence->fields, ElementsAre("", "V", "", ""));
}

TEST(NmeaSentence, ProprietaryOnesHaveNoTalkerButQuectelsBeidouHas) {
  EXPECT_EQ(parse_nmea_sentence(nmea("PUBX,00,1")).sentence->type, "PUBX");
  EXPECT_EQ(parse_nmea_sentence(nmea("PUBX,00,1")).sentence->talker, "");
  EXPECT_EQ(parse_nmea_sentence(nmea("PQGSV,1,1,00,0,4")).sentence->talker, "PQ");
  EXPECT_EQ(parse_nmea_sentence(nmea("PQGSV,1,1,00,0,4")).sentence->type, "GSV");
}

TEST(NmeaSentence, WhatStandsBeforeAndBehindIsLeftOut) {
  EXPECT_TRUE(parse_nmea_sentence("1581041657.25: " + nmea("GPZDA,1") + " \r\n").sentence);
  EXPECT_TRUE(parse_nmea_sentence("$GPRM" + nmea("GPZDA,1")).sentence);  // a cut one before it
}

TEST(NmeaSentence, ARefusalHasItsReason) {
  const std::string good = nmea("GPZDA,094737,20,08,2018,-01,00");
  std::string flipped = good;
  flipped[8] ^= 1;
  EXPECT_EQ(parse_nmea_sentence(flipped).refusal, NmeaRefusal::kWrongChecksum);
  EXPECT_EQ(parse_nmea_sentence(good.substr(0, 20)).refusal, NmeaRefusal::kNoChecksum);
  EXPECT_EQ(parse_nmea_sentence(good.substr(0, good.size() - 1)).refusal, NmeaRefusal::kNoChecksum);
  EXPECT_EQ(parse_nmea_sentence("").refusal, NmeaRefusal::kNoStart);
  EXPECT_EQ(parse_nmea_sentence("{\"class\":\"TPV\"}").refusal, NmeaRefusal::kNoStart);
  EXPECT_EQ(parse_nmea_sentence(nmea("GPZDA,\x01")).refusal, NmeaRefusal::kBadCharacter);
  EXPECT_EQ(parse_nmea_sentence(nmea("GP,1")).refusal, NmeaRefusal::kBadAddress);
  EXPECT_EQ(parse_nmea_sentence(nmea("gpgga,1")).refusal, NmeaRefusal::kBadAddress);
  EXPECT_EQ(parse_nmea_sentence(nmea("GPZDA," + std::string(2000, '1'))).refusal, NmeaRefusal::kTooLong);
  EXPECT_STREQ(to_string(NmeaRefusal::kWrongChecksum), "its checksum is wrong");
}

TEST(NmeaLines, SentencesAreFoundBetweenBinaryMessages) {
  const std::string log = std::string("\xB5\x62\x01\x07\x00\x24q", 7) + nmea("GPZDA,1") + "\r\n" +
                          std::string("\x00\x00", 2) + nmea("GPZDA,2") + nmea("GPZDA,3");
  int found = 0;
  for (const auto line : split_nmea_lines(log)) found += parse_nmea_sentence(line).sentence ? 1 : 0;
  EXPECT_EQ(found, 3);
  EXPECT_TRUE(split_nmea_lines("").empty());
}

TEST(NmeaFields, NumbersAreDecimalAndFinite) {
  EXPECT_THAT(to_number("-21.40"), Optional(-21.4));
  EXPECT_THAT(to_number("00242.2"), Optional(242.2));
  EXPECT_THAT(to_number("+.5"), Optional(0.5));
  EXPECT_THAT(to_number("0.12345678901234567890123"), Optional(testing::DoubleNear(0.12345678901234568, 1e-15)));
  for (const char* bad : {"", "-", ".", "1e5", "nan", "inf", "1.2.3", "0x10", " 1", "1 ", "--1"}) {
    EXPECT_FALSE(to_number(bad)) << bad;
  }
  EXPECT_FALSE(to_number(std::string(400, '9')));
  EXPECT_FALSE(to_count("-1"));
  EXPECT_FALSE(to_count("12345678901234567890"));
  EXPECT_THAT(to_count("08"), Optional(8));
}

TEST(NmeaFields, TimesHaveTheirNanoseconds) {
  EXPECT_THAT(to_time_of_day("074150.799"), Optional(Stamp(7h + 41min + 50s + 799ms)));
  EXPECT_THAT(to_time_of_day("235960.5"), Optional(Stamp(24h + 500ms)));  // a leap second
  EXPECT_THAT(to_time_of_day("000000"), Optional(Stamp(0)));
  EXPECT_THAT(to_time_of_day("000000.1234567899999"), Optional(Stamp(123456789)));
  for (const char* bad : {"", "12", "1234567", "246000", "126060", "120061", "12000a", "120000.x", "-10000"}) {
    EXPECT_FALSE(to_time_of_day(bad)) << bad;
  }
}

TEST(NmeaFields, DatesAreThoseOfTheCalendar) {
  EXPECT_THAT(to_day(1970, 1, 1), Optional(0));
  EXPECT_THAT(to_day(2020, 2, 29), Optional(18321));  // date -d 2020-02-29 +%s is 18321 * 86400
  EXPECT_THAT(to_day("070220"), Optional(18299));
  EXPECT_THAT(to_day("010199"), Optional(10592));
  EXPECT_FALSE(to_day(2021, 2, 29));
  EXPECT_FALSE(to_day("320120"));
  EXPECT_FALSE(to_day("001320"));
  EXPECT_FALSE(to_day("0702201"));
}

TEST(NmeaFields, PlacesAreDegreesWithMinutes) {
  EXPECT_THAT(to_latitude_deg("3725.58362", "N"), Optional(testing::DoubleNear(37.0 + 25.58362 / 60.0, 1e-12)));
  EXPECT_THAT(to_longitude_deg("12205.61915", "W"), Optional(testing::DoubleNear(-122.0 - 5.61915 / 60.0, 1e-12)));
  EXPECT_THAT(to_latitude_deg("9000.0", "S"), Optional(-90.0));
  EXPECT_FALSE(to_latitude_deg("9000.1", "N"));
  EXPECT_FALSE(to_latitude_deg("3760.0", "N"));
  EXPECT_FALSE(to_latitude_deg("3725.5", ""));
  EXPECT_FALSE(to_latitude_deg("3725.5", "E"));
  EXPECT_FALSE(to_longitude_deg("-12205.6", "W"));
  EXPECT_FALSE(to_longitude_deg("", "W"));
}

}  // namespace
}  // namespace urban_gnss
