#pragma once

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

#include "urban_gnss_localization/evaluation/stamp_text.hpp"

namespace urban_gnss {

/// A comma-separated file with a header line and one record a line, no quoting. Whatever is wrong is a
/// std::runtime_error that names file, line and column.
class CsvTable {
 public:
  using Column = std::size_t;
  static constexpr Column kAbsent = std::numeric_limits<Column>::max();

  /// Reads the file and puts its records in the order of their column `stamp`; equal stamps keep their order.
  explicit CsvTable(const std::filesystem::path& path) : path_(path.string()) {
    std::ifstream file(path);
    if (!file) throw std::runtime_error(path_ + ": cannot be read");
    std::string line;
    std::size_t number = 0;
    while (std::getline(file, line)) {
      ++number;
      if (number == 1 && line.rfind("\xEF\xBB\xBF", 0) == 0) line.erase(0, 3);
      if (!line.empty() && line.back() == '\r') line.pop_back();
      if (line.empty()) continue;
      if (header_.empty()) {
        header_ = split(line);
        continue;
      }
      Record record{number, Stamp(0), split(line)};
      if (record.cells.size() != header_.size()) {
        throw std::runtime_error(path_ + ":" + std::to_string(number) + ": " + std::to_string(record.cells.size()) +
                                 " columns where the header has " + std::to_string(header_.size()));
      }
      records_.push_back(std::move(record));
    }
    if (file.bad()) throw std::runtime_error(path_ + ": cannot be read");
    if (header_.empty()) throw std::runtime_error(path_ + ": is empty");
    sort_by_stamp();
  }

  std::size_t size() const { return records_.size(); }
  const std::string& path() const { return path_; }
  Stamp stamp(std::size_t row) const { return records_[row].stamp; }

  /// How many records had a stamp before that of the record above them in the file.
  std::size_t descending_count() const { return descending_count_; }

  Column column(const std::string& name) const {
    const Column found = optional_column(name);
    if (found == kAbsent) throw std::runtime_error(path_ + ":1: no column " + name);
    return found;
  }

  /// kAbsent where there is none of that name.
  Column optional_column(const std::string& name) const {
    const auto found = std::find(header_.begin(), header_.end(), name);
    return found == header_.end() ? kAbsent : static_cast<Column>(found - header_.begin());
  }

  /// Empty where the column is absent.
  const std::string& text(std::size_t row, Column column) const {
    static const std::string empty;
    return column == kAbsent ? empty : records_[row].cells[column];
  }

  /// A finite number.
  double number(std::size_t row, Column column) const {
    const double value = optional_number(row, column);
    if (!std::isfinite(value)) throw error(row, column, "is not a finite number");
    return value;
  }

  /// NaN where the cell is empty or the column absent.
  double optional_number(std::size_t row, Column column) const {
    const std::string& cell = text(row, column);
    if (cell.empty()) return std::numeric_limits<double>::quiet_NaN();
    char* end = nullptr;
    const double value = std::strtod(cell.c_str(), &end);
    if (*end != '\0') throw error(row, column, "is not a number");
    return value;
  }

  /// An error about one cell.
  std::runtime_error error(std::size_t row, Column column, const std::string& what) const {
    const std::string name = column == kAbsent ? std::string("?") : header_[column];
    return std::runtime_error(path_ + ":" + std::to_string(records_[row].line) + ": column " + name + ": '" +
                              text(row, column) + "' " + what);
  }

 private:
  struct Record {
    std::size_t line;
    Stamp stamp;
    std::vector<std::string> cells;
  };

  static std::vector<std::string> split(const std::string& line) {
    const auto trimmed = [](const std::string& cell) {
      const std::size_t first = cell.find_first_not_of(" \t");
      if (first == std::string::npos) return std::string();
      return cell.substr(first, cell.find_last_not_of(" \t") - first + 1);
    };
    std::vector<std::string> cells;
    std::size_t start = 0;
    for (std::size_t comma = line.find(','); comma != std::string::npos; comma = line.find(',', start)) {
      cells.push_back(trimmed(line.substr(start, comma - start)));
      start = comma + 1;
    }
    cells.push_back(trimmed(line.substr(start)));
    return cells;
  }

  void sort_by_stamp() {
    const Column stamp_column = column("stamp");
    for (std::size_t row = 0; row < records_.size(); ++row) {
      const auto stamp = parse_stamp(text(row, stamp_column));
      if (!stamp) throw error(row, stamp_column, "is not a stamp in seconds");
      records_[row].stamp = *stamp;
      if (row > 0 && *stamp < records_[row - 1].stamp) ++descending_count_;
    }
    std::stable_sort(records_.begin(), records_.end(),
                     [](const Record& a, const Record& b) { return a.stamp < b.stamp; });
  }

  std::string path_;
  std::vector<std::string> header_;
  std::vector<Record> records_;
  std::size_t descending_count_{0};
};

}  // namespace urban_gnss
