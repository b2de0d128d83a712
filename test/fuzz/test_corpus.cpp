// Every file of the corpus, and what comes of it by a few changes, through the function that libFuzzer calls.

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <string>
#include <tuple>

#include "package_directory.hpp"
#include "target.hpp"

namespace urban_gnss::fuzz {
namespace {

// Changes of a target's corpus: ten parts, of which the sanitizers get the first. More: dev/fuzz.sh, or
// --gtest_random_seed=2.
constexpr unsigned kParts = 10;
constexpr int kCases = 250;

const std::vector<std::string> kWords{"0",
                                      "-1",
                                      "1e308",
                                      "-1e308",
                                      "nan",
                                      "inf",
                                      "4294967295",
                                      "-2147483649",
                                      "",
                                      "1e-320",
                                      "99999999999999999999",
                                      "\n",
                                      ",",
                                      ": ",
                                      "[",
                                      "]",
                                      "{}",
                                      "*a",
                                      "&a ",
                                      std::string(4, '\xff'),
                                      std::string(8, '\0'),
                                      std::string(300, '9')};

std::vector<std::string> read_corpus(const std::string& target) {
  std::vector<std::filesystem::path> paths;
  for (const auto& entry : std::filesystem::directory_iterator(package_directory() + "/test/fuzz/corpus/" + target)) {
    paths.push_back(entry.path());
  }
  std::sort(paths.begin(), paths.end());  // the order of a folder is any
  std::vector<std::string> corpus;
  for (const auto& path : paths) {
    std::ifstream file(path, std::ios::binary);
    corpus.emplace_back(std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>());
  }
  return corpus;
}

/// Changes bytes as libFuzzer does, blindly.
class Mutator {
 public:
  Mutator(const std::vector<std::string>& corpus, unsigned seed) : corpus_(corpus), random_(seed) {}

  std::string draw() {
    std::string bytes = corpus_[upto(corpus_.size())];
    for (std::size_t changes = 1 + upto(4); changes > 0; --changes) change(bytes);
    return bytes;
  }

 private:
  // Not a distribution of the library, which may draw otherwise in its next version.
  std::size_t upto(std::size_t size) { return size == 0 ? 0 : random_() % size; }

  void change(std::string& bytes) {
    const std::size_t at = upto(bytes.size() + 1);
    const std::size_t length = std::min(upto(40), bytes.size() - at);
    switch (upto(6)) {
      case 0: bytes.erase(at, length); break;
      case 1: bytes.insert(at, bytes.substr(upto(bytes.size()), length)); break;
      case 2: bytes.insert(at, kWords[upto(kWords.size())]); break;
      case 3: replace_word(bytes, at); break;
      case 4: cross(bytes, at); break;
      default:
        if (at < bytes.size()) bytes[at] = static_cast<char>(bytes[at] ^ (1 << upto(8)));
    }
  }
  /// The next number becomes another.
  void replace_word(std::string& bytes, std::size_t at) {
    const std::size_t begin = bytes.find_first_of("0123456789", at);
    if (begin == std::string::npos) return;
    const std::size_t end = std::min(bytes.find_first_not_of("0123456789.", begin), bytes.size());
    bytes.replace(begin, end - begin, kWords[upto(kWords.size())]);
  }
  /// Goes on as another file.
  void cross(std::string& bytes, std::size_t at) {
    const std::string& other = corpus_[upto(corpus_.size())];
    bytes = bytes.substr(0, at) + other.substr(upto(other.size()));
  }

  const std::vector<std::string>& corpus_;
  std::mt19937 random_;
};

class Corpus : public testing::TestWithParam<std::tuple<Target, unsigned>> {};

TEST_P(Corpus, IsReadOrRefused) {
  const auto& [target, part] = GetParam();
  const std::vector<std::string> corpus = read_corpus(target.name);
  ASSERT_FALSE(corpus.empty());
  if (part == 0) {
    for (const std::string& bytes : corpus) EXPECT_NO_THROW(target.run(bytes)) << bytes;
  }
  Mutator mutator(corpus, kParts * static_cast<unsigned>(testing::GTEST_FLAG(random_seed)) + part);
  for (int i = 0; i < kCases; ++i) {
    const std::string bytes = mutator.draw();
    ASSERT_NO_THROW(target.run(bytes)) << bytes;
  }
}

std::string name_of(const testing::TestParamInfo<std::tuple<Target, unsigned>>& info) {
  const auto& [target, part] = info.param;
  return target.name + (part == 0 ? std::string() : "_more" + std::to_string(part));
}

INSTANTIATE_TEST_SUITE_P(All, Corpus, testing::Combine(testing::ValuesIn(targets()), testing::Range(0U, kParts)),
                         name_of);

}  // namespace
}  // namespace urban_gnss::fuzz
