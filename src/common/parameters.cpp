#include "urban_gnss_localization/common/parameters.hpp"

#include <sstream>

namespace urban_gnss {
namespace {

std::string number(double value) {
  std::ostringstream out;
  out << value;
  return out.str();
}

}  // namespace

std::string Range::describe() const {
  const bool has_low = std::isfinite(low);
  const bool has_high = std::isfinite(high);
  if (has_low && has_high) {
    return (low_open ? "greater than " : "at least ") + number(low) + " and at most " + number(high);
  }
  if (has_low) return (low_open ? "a finite number greater than " : "a finite number of at least ") + number(low);
  if (has_high) return "a finite number of at most " + number(high);
  return "a finite number";
}

ParameterError::ParameterError(const std::string& where, const std::vector<std::string>& faults)
    : std::runtime_error([&] {
        std::string message =
            where + ": " + std::to_string(faults.size()) + (faults.size() == 1 ? " bad parameter" : " bad parameters");
        for (const auto& fault : faults) message += "\n  - " + fault;
        return message;
      }()) {}

void ParameterCheck::on_number(const ParameterKey& key, double& value, const Range& range) {
  if (!range.contains(value)) {
    faults_.push_back(std::string(key.name) + " = " + number(value) + ": must be " + range.describe());
  }
}

void ParameterCheck::on_integer(const ParameterKey& key, int& value, const Range& range) {
  double number = value;
  on_number(key, number, range);
}

void ParameterCheck::on_list(const ParameterKey& key, std::vector<double>& value) {
  for (const double element : value) {
    if (!std::isfinite(element)) faults_.push_back(std::string(key.name) + ": must be finite numbers");
  }
}

void ParameterCheck::on_end(const std::vector<std::string>& faults) {
  faults_.insert(faults_.end(), faults.begin(), faults.end());
}

}  // namespace urban_gnss
