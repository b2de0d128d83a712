#include "urban_gnss_localization/evaluation/tum.hpp"

#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <istream>
#include <ostream>
#include <sstream>
#include <stdexcept>
#include <string>

#include "urban_gnss_localization/evaluation/stamp_text.hpp"

namespace urban_gnss {
namespace {

/// One number with nine decimals. A minus zero loses its sign, so that equal poses give equal text.
std::string fixed(double value) {
  char text[352];  // the largest double has 309 digits before the point
  std::snprintf(text, sizeof(text), " %.9f", value);
  return std::string(text) == " -0.000000000" ? " 0.000000000" : text;
}

TimedPose parse_line(const std::string& line) {
  std::istringstream words(line);
  std::string word;
  words >> word;
  const auto stamp = parse_stamp(word);
  if (!stamp) throw std::runtime_error("'" + word + "' is not a stamp");

  std::array<double, 7> numbers{};
  for (double& number : numbers) {
    if (!(words >> word)) throw std::runtime_error("fewer than eight numbers");
    char* end = nullptr;
    number = std::strtod(word.c_str(), &end);
    if (*end != '\0' || !std::isfinite(number)) throw std::runtime_error("'" + word + "' is not a finite number");
  }
  if (words >> word) throw std::runtime_error("more than eight numbers");

  const Eigen::Vector4d written(numbers[3], numbers[4], numbers[5], numbers[6]);
  const double largest = written.cwiseAbs().maxCoeff();
  if (!(largest > 0.0)) throw std::runtime_error("the quaternion is zero");
  // Not normalised, for the angle is homogeneous in it. A power of two keeps the squares within what a number can be.
  const int exponent = std::ilogb(largest);
  const Eigen::Vector4d q = written.unaryExpr([&](double part) { return std::scalbn(part, -exponent); });
  TimedPose pose;
  pose.stamp = *stamp;
  pose.pose = {numbers[0], numbers[1],
               std::atan2(2.0 * (q[3] * q[2] + q[0] * q[1]), q[3] * q[3] + q[0] * q[0] - q[1] * q[1] - q[2] * q[2])};
  return pose;
}

}  // namespace

void write_tum(std::ostream& out, const Trajectory& trajectory) {
  for (const TimedPose& pose : trajectory) {
    if (!is_finite(pose.pose)) {
      throw std::invalid_argument("the pose at " + format_stamp(pose.stamp) + " s is not finite");
    }
    const double half_yaw = 0.5 * pose.pose.yaw;
    out << format_stamp(pose.stamp);
    for (const double value : {pose.pose.x, pose.pose.y, 0.0, 0.0, 0.0, std::sin(half_yaw), std::cos(half_yaw)}) {
      out << fixed(value);
    }
    out << '\n';
  }
}

Trajectory read_tum(std::istream& in) {
  Trajectory trajectory;
  std::string line;
  for (std::size_t number = 1; std::getline(in, line); ++number) {
    const std::size_t start = line.find_first_not_of(" \t\r");
    if (start == std::string::npos || line[start] == '#') continue;
    try {
      trajectory.push_back(parse_line(line));
    } catch (const std::runtime_error& error) {
      throw std::runtime_error("line " + std::to_string(number) + ": " + error.what());
    }
  }
  sort_by_stamp(trajectory);
  return trajectory;
}

}  // namespace urban_gnss
