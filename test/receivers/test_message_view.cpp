#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdint>
#include <functional>
#include <random>

#include "message_bytes.hpp"
#include "urban_gnss_localization/receivers/message_view.hpp"

namespace urban_gnss {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

const std::string kText = R"(# Everything
Header header
uint8 A_CONSTANT=7
string A_TEXT= not a field # nor a comment
bool flag
byte old_signed   # int8
char old_unsigned
int16 small
uint32 large	# with a tab
int64 huge
float32 single
float64 exact
duration gap
string name
uint8[3] fixed
int16[] counts
Point place
other_msgs/Part[] parts
)";

std::string full_text() {
  return kText + kHeaderDefinition +
         "================================================================================\r\n"
         "MSG: test_msgs/Point\r\nfloat64 x\r\nfloat64 y\r\n"
         "===\n\nMSG: other_msgs/Part\nstring label\nuint8 id\nfloat32[2] pair\n";
}

std::vector<std::uint8_t> full_message() {
  MessageBytes bytes;
  bytes.header(100, 5, "antenna").put(std::uint8_t{1}).put(std::int8_t{-3}).put(std::uint8_t{200});
  bytes.put(std::int16_t{-1000}).put(std::uint32_t{4000000000U}).put(std::int64_t{-5}).put(1.5F).put(2.25);
  bytes.put(std::int32_t{-2}).put(std::int32_t{500000000}).text("Zoë");
  bytes.put(std::uint8_t{1}).put(std::uint8_t{2}).put(std::uint8_t{3}).array(std::vector<std::int16_t>{-1, 300});
  bytes.put(11.0).put(12.0);
  bytes.put(std::uint32_t{2}).text("one").put(std::uint8_t{1}).put(0.5F).put(0.25F);
  bytes.text("").put(std::uint8_t{2}).put(-0.5F).put(-0.25F);
  return bytes.bytes();
}

TEST(MessageView, ReadsEveryTypeOfField) {
  const MessageDefinition definition("test_msgs/All", "abc", full_text());
  const std::vector<std::uint8_t> bytes = full_message();
  const MessageView view(definition, bytes.data(), bytes.size());
  EXPECT_EQ(view.stamp("header.stamp"), Stamp(100000000005));
  EXPECT_EQ(view.text("header.frame_id"), "antenna");
  EXPECT_EQ(view.integer("flag"), 1);
  EXPECT_EQ(view.integer("old_signed"), -3);
  EXPECT_EQ(view.integer("old_unsigned"), 200);
  EXPECT_EQ(view.integer("small"), -1000);
  EXPECT_EQ(view.integer("large"), 4000000000);
  EXPECT_EQ(view.number("huge"), -5.0);
  EXPECT_EQ(view.number("single"), 1.5);
  EXPECT_EQ(view.number("exact"), 2.25);
  EXPECT_EQ(view.stamp("gap"), Stamp(-1500000000));
  EXPECT_EQ(view.text("name"), "Zoë");
  EXPECT_THAT(view.numbers("fixed"), ElementsAre(1, 2, 3));
  EXPECT_THAT(view.numbers("counts"), ElementsAre(-1, 300));
  EXPECT_EQ(view.number("place.y"), 12.0);
  const std::vector<MessageView> parts = view.items("parts");
  ASSERT_EQ(parts.size(), 2U);
  EXPECT_EQ(parts[0].text("label"), "one");
  EXPECT_EQ(parts[1].integer("id"), 2);
  EXPECT_THAT(parts[1].numbers("pair"), ElementsAre(-0.5, -0.25));
  EXPECT_FALSE(view.has("A_CONSTANT"));
  EXPECT_EQ(view.number_or("nothing", 4.0), 4.0);
  EXPECT_THAT(view.numbers_if_any("nothing"), IsEmpty());
}

std::string error_of(const std::function<void()>& act) {
  try {
    act();
  } catch (const MessageError& error) {
    return error.what();
  }
  return "no error";
}

TEST(MessageView, AnErrorNamesTypeMd5AndField) {
  const MessageDefinition definition("test_msgs/All", "0123abcd", full_text());
  const std::vector<std::uint8_t> bytes = full_message();
  const MessageView view(definition, bytes.data(), bytes.size());
  const auto names = [](const std::string& field) {
    return AllOf(HasSubstr("test_msgs/All"), HasSubstr("0123abcd"), HasSubstr(field));
  };
  EXPECT_THAT(error_of([&] { view.number("header.no"); }), names("header.no"));
  EXPECT_THAT(error_of([&] { view.items("parts").front().number("no"); }), names("parts[].no"));
  EXPECT_THAT(error_of([&] { view.number("name"); }), names("name"));
  EXPECT_THAT(error_of([&] { view.integer("exact"); }), names("exact"));
  EXPECT_THAT(error_of([&] { view.number("fixed"); }), names("fixed"));
  EXPECT_THAT(error_of([&] { view.stamp("small"); }), names("small"));
  EXPECT_THAT(error_of([&] { view.items("counts"); }), names("counts"));
  EXPECT_THAT(error_of([&] { view.number("parts.id"); }), names("parts.id"));
}

TEST(MessageView, DataThatDoNotFitAreRefused) {
  const MessageDefinition definition("test_msgs/All", "0123abcd", full_text());
  std::vector<std::uint8_t> bytes = full_message();
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    EXPECT_THAT(error_of([&] { MessageView(definition, bytes.data(), size); }), HasSubstr("is cut off")) << size;
  }
  bytes.push_back(0);
  EXPECT_THAT(error_of([&] { MessageView(definition, bytes.data(), bytes.size()); }), HasSubstr("1 more"));
}

TEST(MessageView, LengthsAreNotTrusted) {
  const MessageDefinition definition("a/B", "x", "float64[] values\nstring[] names\n");
  const auto view = [&](std::uint32_t values, std::uint32_t names) {
    const std::vector<std::uint8_t> bytes = MessageBytes().put(values).put(names).put(std::uint32_t{0}).bytes();
    return error_of([&] { MessageView(definition, bytes.data(), bytes.size()).numbers("values"); });
  };
  EXPECT_EQ(view(0, 1), "no error");
  EXPECT_THAT(view(0xFFFFFFFF, 0), HasSubstr("is cut off"));
  EXPECT_THAT(view(0x20000000, 0), HasSubstr("is cut off"));
  EXPECT_THAT(view(0, 0xFFFFFFFF), HasSubstr("is cut off"));
}

TEST(MessageDefinition, MalformedTextsAreRefused) {
  const auto error = [](const std::string& text) { return error_of([&] { MessageDefinition("a/B", "md5", text); }); };
  const std::string next = "\n=====\n";
  EXPECT_EQ(error(""), "no error");
  EXPECT_THAT(error("uint8"), HasSubstr("without a name"));
  EXPECT_THAT(error("uint8 a b"), HasSubstr("no field"));
  EXPECT_THAT(error("uint8 9a"), HasSubstr("no field"));
  EXPECT_THAT(error("uint8 a\nint8 a"), HasSubstr("two fields a"));
  EXPECT_THAT(error("uint9 a"), AllOf(HasSubstr("a/B (md5 md5)"), HasSubstr("lacks the type a/uint9")));
  EXPECT_THAT(error("Other a" + next + "MSG: c/Other\nuint8 x"), HasSubstr("lacks the type a/Other"));
  EXPECT_THAT(error("uint8[x] a"), HasSubstr("length of an array"));
  EXPECT_THAT(error("uint8[2][] a"), HasSubstr("length of an array"));
  EXPECT_THAT(error("uint8[99999999999] a"), HasSubstr("length of an array"));
  EXPECT_THAT(error("Other o" + next + "Other\nuint8 x"), HasSubstr("MSG:"));
  EXPECT_THAT(error("Other o" + next + "MSG: a/Other\nOther o"), HasSubstr("within itself"));
  EXPECT_THAT(error("E[] e" + next + "MSG: a/E\n# nothing"), HasSubstr("without fields"));
  EXPECT_THAT(error("float64[200000000] a"), HasSubstr("too large"));
  std::string deep = "T0 t";
  for (int i = 0; i < 60; ++i) deep += next + "MSG: a/T" + std::to_string(i) + "\nT" + std::to_string(i + 1) + "[9] t";
  EXPECT_THAT(error(deep), HasSubstr("more than"));
}

/// Reads whatever there is, by every name there is.
void read_all(const MessageView& view, const MessageDefinition& definition, const MessageDefinition::Type& type) {
  for (const MessageDefinition::Field& field : type.fields) {
    if (field.length == MessageDefinition::kNoArray) {
      if (field.kind <= FieldKind::kFloat64) view.number(field.name);
      if (field.kind == FieldKind::kString) view.text(field.name);
      if (field.kind == FieldKind::kTime || field.kind == FieldKind::kDuration) view.stamp(field.name);
    } else if (field.kind == FieldKind::kMessage) {
      for (const MessageView& item : view.items(field.name)) read_all(item, definition, definition.at(field.type));
    } else if (field.kind <= FieldKind::kFloat64) {
      view.numbers(field.name);
    }
  }
}

TEST(MessageView, SurvivesAnyBytes) {
  const MessageDefinition definition("test_msgs/All", "abc", full_text());
  const std::vector<std::uint8_t> good = full_message();
  std::mt19937 random(11);
  int readable = 0;
  for (int round = 0; round < 20000; ++round) {
    std::vector<std::uint8_t> bytes = good;
    const int changes = 1 + static_cast<int>(random() % 6);
    for (int i = 0; i < changes; ++i) bytes[random() % bytes.size()] = static_cast<std::uint8_t>(random());
    if (random() % 3 == 0) bytes.resize(random() % (2 * good.size()));
    try {
      read_all(MessageView(definition, bytes.data(), bytes.size()), definition, definition.root());
      ++readable;
    } catch (const MessageError&) {
    }
  }
  EXPECT_GT(readable, 1000);
  EXPECT_LT(readable, 19000);
}

TEST(MessageDefinition, SurvivesAnyText) {
  const std::string good = full_text();
  std::mt19937 random(12);
  int accepted = 0;
  for (int round = 0; round < 20000; ++round) {
    std::string text = good;
    const int changes = 1 + static_cast<int>(random() % 4);
    for (int i = 0; i < changes; ++i) text[random() % text.size()] = "=[]#\n \t9aMSG:/\0\xff"[random() % 17];
    if (random() % 4 == 0) text.resize(random() % text.size());
    const std::vector<std::uint8_t> bytes = full_message();
    try {
      const MessageDefinition definition("test_msgs/All", "abc", text);
      ++accepted;
      read_all(MessageView(definition, bytes.data(), bytes.size()), definition, definition.root());
    } catch (const MessageError&) {
    }
  }
  EXPECT_GT(accepted, 1000);
  EXPECT_LT(accepted, 19000);
}

}  // namespace
}  // namespace urban_gnss
