#include "pcd_header.hpp"

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <optional>
#include <set>
#include <sstream>
#include <stdexcept>
#include <vector>

namespace urban_gnss {
namespace {

constexpr char kOldFields[] = "COLUMNS";  // of FIELDS, in old files
constexpr std::size_t kLongestLine = 1 << 16;
constexpr std::uint64_t kLargestPoint = 1 << 16;  // bytes
constexpr std::uint64_t kMostPoints = 1ULL << 31;

/// A number without sign that is all of a word.
std::optional<std::uint64_t> to_number(const std::string& word) {
  constexpr std::size_t kMostDigits = 18;
  if (word.empty() || word.size() > kMostDigits || word.find_first_not_of("0123456789") != std::string::npos) {
    return std::nullopt;
  }
  return std::stoull(word);
}

class PcdCheck {
 public:
  explicit PcdCheck(const std::string& path) : path_(path), file_(path, std::ios::binary) {}

  std::uint64_t run() {
    std::error_code error;
    if (!file_ || !std::filesystem::is_regular_file(path_, error)) {
      throw std::runtime_error(path_ + ": cannot be read: " + (errno != 0 ? std::strerror(errno) : "is no file"));
    }
    read_entries();
    check_fields();
    check_points();
    const auto begin = static_cast<std::uint64_t>(file_.tellg());
    rest_ = std::filesystem::file_size(path_) - begin;
    check_end_of_header();
    file_.clear();
    file_.seekg(static_cast<std::streamoff>(begin));
    check_data(entries_["DATA"].front());
    return points_;
  }

 private:
  [[noreturn]] void fail(const std::string& what) const {
    throw std::runtime_error(path_ + ": is no .pcd file that can be read: " + what);
  }

  /// In the order that the format prescribes. PCL takes others: it makes memory for the points when it comes to POINTS,
  /// of the size that they have by the entries until then.
  static const std::vector<std::string>& entry_names() {
    static const std::vector<std::string> names{"VERSION", "FIELDS", "SIZE",      "TYPE",   "COUNT",
                                                "WIDTH",   "HEIGHT", "VIEWPOINT", "POINTS", "DATA"};
    return names;
  }
  /// Whether PCL takes a word for this entry.
  static bool begins_with(const std::string& word, const std::string& entry) {
    return word.compare(0, entry.size(), entry) == 0;
  }

  /// PCL reads on after DATA, until a line that is neither empty, a comment nor an entry: points that look like entries
  /// would be taken for them, after memory was made for others.
  void check_end_of_header() {
    std::string line;
    while (read_line(line) || !line.empty()) {
      std::istringstream words(line);
      std::string name;
      words >> name;
      for (const std::string& entry : entry_names()) {
        if (begins_with(name, entry)) fail("its points look like an entry " + entry);
      }
      if (begins_with(name, kOldFields)) fail(std::string("its points look like an entry ") + kOldFields);
      if (!name.empty() && name.front() != '#') return;
      line.clear();
    }
  }

  void read_entries() {
    std::string line;
    auto last = entry_names().begin();
    while (entries_.count("DATA") == 0) {
      if (!read_line(line)) fail("its header has no entry DATA");
      if (line.empty()) continue;
      std::istringstream words(line);
      std::string name;
      words >> name;
      // PCL takes it for the end of the header, and then looks at points for which it has no memory.
      if (name.empty()) fail("a line of its header is of spaces");
      if (name.front() == '#') continue;
      if (line.find_first_of("\v\f") != std::string::npos) fail("a line of its header has other spaces than PCL takes");
      if (name == kOldFields) name = "FIELDS";
      const auto entry = std::find(entry_names().begin(), entry_names().end(), name);
      if (entry == entry_names().end()) fail("its header has an unknown entry");
      std::vector<std::string> values{std::istream_iterator<std::string>(words), {}};
      if (!entries_.emplace(name, values).second) fail(name + " stands twice in its header");
      if (entry < last) fail(name + " stands behind " + *last + " in its header");
      last = entry;
      if (values.empty()) fail(name + " is empty");
    }
  }
  bool read_line(std::string& line) {
    line.clear();
    for (int c = file_.get(); c != '\n'; c = file_.get()) {
      if (c == std::ifstream::traits_type::eof() || line.size() >= kLongestLine) return false;
      line.push_back(static_cast<char>(c));
    }
    return true;
  }

  /// The values of an entry, one for each field.
  const std::vector<std::string>& column(const std::string& name) {
    const std::vector<std::string>& values = entries_[name];
    if (values.size() != entries_["FIELDS"].size()) fail(name + " must have a value for each of FIELDS");
    return values;
  }
  std::uint64_t number(const std::string& name, const std::string& word, std::uint64_t least,
                       std::uint64_t most) const {
    const auto value = to_number(word);
    if (!value || *value < least || *value > most) {
      fail(name + " must be whole numbers of " + std::to_string(least) + " to " + std::to_string(most));
    }
    return *value;
  }

  void check_fields() {
    if (entries_.count("FIELDS") == 0) fail("its header has no entry FIELDS");
    const std::vector<std::string>& names = entries_["FIELDS"];
    if (entries_.count("COUNT") == 0) entries_["COUNT"].assign(names.size(), "1");
    std::set<std::string> coordinates;
    for (std::size_t i = 0; i < names.size(); ++i) {
      const std::uint64_t size = number("SIZE", column("SIZE")[i], 1, sizeof(double));
      const std::uint64_t count = number("COUNT", column("COUNT")[i], 1, kLargestPoint);
      const std::string& type = column("TYPE")[i];
      const bool is_float = type == "F" && size >= sizeof(float);
      if ((size & (size - 1)) != 0 || !(is_float || type == "I" || type == "U")) fail("no such TYPE and SIZE");
      const bool is_coordinate = names[i] == "x" || names[i] == "y" || names[i] == "z";
      if (is_coordinate && is_float && size == sizeof(float) && count == 1) coordinates.insert(names[i]);
      point_size_ += size * count;
      values_ += count;
      if (point_size_ > kLargestPoint) fail("its points are too large");
    }
    if (coordinates.size() != 3) fail("it needs x, y and z in single precision");
  }

  void check_points() {
    const auto one = [&](const std::string& name) -> std::optional<std::uint64_t> {
      const auto found = entries_.find(name);
      if (found == entries_.end()) return std::nullopt;
      return number(name, found->second.front(), 0, kMostPoints);
    };
    const auto width = one("WIDTH");
    const auto all = one("POINTS");
    if (!width && !all) fail("its header has neither WIDTH nor POINTS");
    const std::uint64_t product = width.value_or(all.value_or(0)) * one("HEIGHT").value_or(1);
    points_ = all.value_or(product);
    if (points_ != product) fail("POINTS must be WIDTH times HEIGHT");
    if (points_ * point_size_ > kMostPoints) fail("it is larger than 2 GiB");
    if (entries_.count("VIEWPOINT") > 0 && entries_["VIEWPOINT"].size() != 7) fail("VIEWPOINT must have seven numbers");
  }

  void check_data(const std::string& kind) {
    const std::uint64_t size = points_ * point_size_;
    if (kind == "binary") {
      require(size);
    } else if (kind == "binary_compressed") {
      constexpr std::uint64_t kBestRatio = 100;  // three bytes of LZF stand for 264 at most
      std::uint32_t sizes[2] = {};
      require(sizeof(sizes));
      file_.read(reinterpret_cast<char*>(sizes), sizeof(sizes));
      require(sizeof(sizes) + sizes[0]);
      if (sizes[1] != size || size > kBestRatio * sizes[0])
        fail("its compressed data have another size than POINTS says");
    } else if (kind == "ascii") {
      check_lines();
    } else {
      fail("DATA must be ascii, binary or binary_compressed");
    }
  }
  void require(std::uint64_t size) const {
    if (rest_ >= size) return;
    fail("it is cut off: it has " + std::to_string(rest_) + " bytes of points where its header says " +
         std::to_string(size));
  }
  void check_lines() {
    std::string line;
    for (std::uint64_t point = 0; point < points_;) {
      if (!read_line(line) && line.empty()) {
        fail("it is cut off: it has " + std::to_string(point) + " points where its header says " +
             std::to_string(points_));
      }
      std::istringstream words(line);
      const auto count = std::distance(std::istream_iterator<std::string>(words), {});
      if (count == 0) continue;
      if (static_cast<std::uint64_t>(count) != values_) {
        fail("point " + std::to_string(point + 1) + " has " + std::to_string(count) + " numbers in place of " +
             std::to_string(values_));
      }
      ++point;
    }
  }

  std::string path_;
  std::ifstream file_;
  std::map<std::string, std::vector<std::string>> entries_;
  std::uint64_t point_size_{0};  ///< bytes
  std::uint64_t values_{0};      ///< of a point
  std::uint64_t points_{0};
  std::uint64_t rest_{0};  ///< bytes after the header
};

}  // namespace

std::uint64_t check_pcd(const std::string& path) {
  errno = 0;
  return PcdCheck(path).run();
}

}  // namespace urban_gnss
