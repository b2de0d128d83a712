// Makes a bag out of a folder of recorded CSV files (gnss, odometry, satellites, velocity, IMU, truth and meta.json).

#include <geometry_msgs/TwistWithCovarianceStamped.h>
#include <nav_msgs/Odometry.h>
#include <sensor_msgs/Imu.h>
#include <sensor_msgs/NavSatFix.h>
#include <tf2_msgs/TFMessage.h>
#include <urban_gnss_localization/SatelliteArray.h>

#include <algorithm>
#include <cmath>
#include <exception>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iomanip>
#include <iostream>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "bag_contents.hpp"
#include "command_line.hpp"
#include "csv_table.hpp"
#include "urban_gnss_localization/geometry/angles.hpp"
#include "urban_gnss_localization/geometry/local_frame.hpp"
#include "urban_gnss_localization/geometry/pose2.hpp"
#include "urban_gnss_localization/gnss/fix.hpp"
#include "urban_gnss_localization/motion/motion_model.hpp"
#include "urban_gnss_localization/ros/conversions.hpp"
#include "urban_gnss_localization/ros/topics.hpp"

namespace {

namespace fs = std::filesystem;
namespace topics = urban_gnss::topics;
using urban_gnss::BagContents;
using urban_gnss::CsvTable;
using urban_gnss::GeodeticPosition;
using urban_gnss::LocalFrame;
using urban_gnss::Pose2;
using urban_gnss::Stamp;

/// Standard deviations that the CSV files do not tell.
struct OdometryNoise {
  double speed_mps{0.05};
  double speed_share{0.02};  ///< grows with the speed: wheel radius, slip
  double yaw_rate_rad_s{0.01};
};

CsvTable read_table(const fs::path& path) {
  CsvTable table(path);
  if (table.descending_count() > 0) {
    std::cerr << table.path() << ": sorted by stamp: " << table.descending_count()
              << " rows were older than the row above them\n";
  }
  return table;
}

GeodeticPosition read_origin(const fs::path& path) {
  std::ifstream file(path);
  if (!file) throw std::runtime_error(path.string() + ": cannot be read");
  try {
    const auto origin = nlohmann::json::parse(file).at("origin");
    return {origin.at("lat_deg").get<double>(), origin.at("lon_deg").get<double>(),
            origin.at("ellipsoid_height_m").get<double>()};
  } catch (const nlohmann::json::exception& error) {
    throw std::runtime_error(path.string() + ": origin {lat_deg, lon_deg, ellipsoid_height_m}: " + error.what());
  }
}

/// Pose by dead reckoning from zero at the first row. A row's speed and yaw rate hold since the row before it.
void add_odometry(const CsvTable& table, const OdometryNoise& noise, BagContents& contents) {
  constexpr double kMaxGapS = 1.0;  // what happened in a longer gap is not known: the pose stays where it was
  const auto speed_column = table.column("v");
  const auto yaw_rate_column = table.column("yaw_rate");
  Pose2 pose;
  std::size_t repeated = 0;
  for (std::size_t row = 0; row < table.size(); ++row) {
    const double speed = table.number(row, speed_column);
    const double yaw_rate = table.number(row, yaw_rate_column);
    if (row > 0) {
      // A second transform with the same stamp is an error to tf, and no time has passed in which to move.
      if (table.stamp(row) == table.stamp(row - 1)) {
        ++repeated;
        continue;
      }
      const double dt = urban_gnss::to_seconds(table.stamp(row) - table.stamp(row - 1));
      if (dt <= kMaxGapS) {
        pose = urban_gnss::move(pose, {speed, yaw_rate}, dt);
      }
    }
    nav_msgs::Odometry odometry;
    odometry.header.stamp = urban_gnss::to_ros_or_throw(table.stamp(row));
    odometry.header.frame_id = "odom";
    odometry.child_frame_id = "base_link";
    odometry.pose.pose = urban_gnss::to_message(pose);
    odometry.twist.twist.linear.x = speed;
    odometry.twist.twist.angular.z = yaw_rate;
    const double speed_sigma = std::hypot(noise.speed_mps, noise.speed_share * speed);
    odometry.twist.covariance[0] = speed_sigma * speed_sigma;
    odometry.twist.covariance[7] = noise.speed_mps * noise.speed_mps;
    odometry.twist.covariance[35] = noise.yaw_rate_rad_s * noise.yaw_rate_rad_s;
    for (const std::size_t diagonal : {14, 21, 28}) {
      odometry.twist.covariance[diagonal] = urban_gnss::kUnobservedVariance;
    }

    tf2_msgs::TFMessage transforms;
    transforms.transforms.push_back(
        urban_gnss::to_transform(pose, odometry.header.stamp, odometry.header.frame_id, odometry.child_frame_id));

    contents.add("tf", table.stamp(row), transforms);
    contents.add(topics::kOdometry, table.stamp(row), odometry);
  }
  if (repeated > 0) {
    std::cerr << table.path() << ": left out " << repeated << " rows with the stamp of the row before them\n";
  }
}

void add_fixes(const CsvTable& table, const LocalFrame& frame, BagContents& contents) {
  const auto latitude = table.column("lat_deg");
  const auto longitude = table.column("lon_deg");
  const auto altitude = table.column("alt_m");
  const auto x = table.optional_column("x");
  const auto y = table.optional_column("y");
  const auto xx = table.optional_column("cov_xx");
  const auto xy = table.optional_column("cov_xy");
  const auto yy = table.optional_column("cov_yy");
  const auto zz = table.optional_column("cov_zz");
  constexpr double kMaxDisagreementM = 1.0;
  double largest_disagreement = 0.0;
  std::size_t repeated = 0;
  for (std::size_t row = 0; row < table.size(); ++row) {
    const GeodeticPosition position{table.number(row, latitude), table.number(row, longitude),
                                    table.optional_number(row, altitude)};
    if (std::abs(position.latitude_deg) > 90.0) throw table.error(row, latitude, "is no latitude");
    auto fix = urban_gnss::to_message(position, urban_gnss::to_ros_or_throw(table.stamp(row)), "gps");
    const double variances[] = {table.optional_number(row, xx), table.optional_number(row, xy),
                                table.optional_number(row, yy), table.optional_number(row, zz)};
    if (std::all_of(std::begin(variances), std::end(variances), [](double v) { return std::isfinite(v); })) {
      fix.position_covariance = {variances[0], variances[1], 0.0, variances[1], variances[2],
                                 0.0,          0.0,          0.0, variances[3]};
      fix.position_covariance_type = sensor_msgs::NavSatFix::COVARIANCE_TYPE_KNOWN;
    }
    contents.add(topics::kFix, table.stamp(row), fix);
    if (row > 0 && table.stamp(row) == table.stamp(row - 1)) ++repeated;

    const double local_x = table.optional_number(row, x);
    const double local_y = table.optional_number(row, y);
    if (!std::isfinite(local_x) || !std::isfinite(local_y) || !std::isfinite(position.altitude_m)) continue;
    const Eigen::Vector3d local = frame.to_local(position);
    const double disagreement = std::hypot(local.x() - local_x, local.y() - local_y);
    if (disagreement > kMaxDisagreementM) {
      std::ostringstream what;
      what << "and y disagree by " << disagreement << " m with lat_deg, lon_deg about meta.json's origin";
      throw table.error(row, x, what.str());
    }
    largest_disagreement = std::max(largest_disagreement, disagreement);
  }
  if (repeated > 0) std::cerr << table.path() << ": " << repeated << " rows have the stamp of the row before them\n";
  std::cout << table.path() << ": x, y agree with latitude, longitude within " << std::setprecision(2)
            << largest_disagreement << " m\n";
}

std::uint8_t constellation(char rinex_letter) {
  using urban_gnss_localization::Satellite;
  switch (rinex_letter) {
    case 'G': return Satellite::GPS;
    case 'R': return Satellite::GLONASS;
    case 'E': return Satellite::GALILEO;
    case 'C': return Satellite::BEIDOU;
    case 'J': return Satellite::QZSS;
    case 'S': return Satellite::SBAS;
    case 'I': return Satellite::NAVIC;
    default: return Satellite::UNKNOWN;
  }
}

/// pi/180 where every angle in the columns is a whole number of degrees, 0 where not.
double angle_resolution(const CsvTable& table, CsvTable::Column azimuth, CsvTable::Column elevation) {
  constexpr double kRounding = 1e-5;  // the files have five decimals
  for (std::size_t row = 0; row < table.size(); ++row) {
    for (const auto column : {azimuth, elevation}) {
      const double degrees = urban_gnss::radians_to_degrees(table.optional_number(row, column));
      if (std::abs(degrees - std::round(degrees)) > urban_gnss::radians_to_degrees(kRounding)) return 0.0;
    }
  }
  return table.size() > 0 ? urban_gnss::degrees_to_radians(1.0) : 0.0;
}

void add_satellites(const CsvTable& table, BagContents& contents) {
  using urban_gnss_localization::Satellite;
  const auto name_column = table.column("sat");
  const auto azimuth_column = table.column("az");
  const auto elevation_column = table.column("el");
  const auto cn0_column = table.optional_column("cn0");
  const auto residual_column = table.optional_column("pr_res_wls");
  const auto received_column = table.optional_column("received");
  const double resolution = angle_resolution(table, azimuth_column, elevation_column);

  for (std::size_t row = 0; row < table.size();) {
    const Stamp stamp = table.stamp(row);
    urban_gnss_localization::SatelliteArray array;
    array.header.stamp = urban_gnss::to_ros_or_throw(stamp);
    array.header.frame_id = "gps";
    array.angle_resolution = static_cast<float>(resolution);
    for (; row < table.size() && table.stamp(row) == stamp; ++row) {
      Satellite satellite;
      satellite.name = table.text(row, name_column);
      const std::string number = satellite.name.empty() ? "" : satellite.name.substr(1);
      if (number.empty() || number.size() > 4 || number.find_first_not_of("0123456789") != std::string::npos ||
          satellite.name.find_first_of("0123456789") == 0) {
        throw table.error(row, name_column, "is no RINEX satellite name");
      }
      satellite.constellation = constellation(satellite.name.front());
      satellite.svid = static_cast<std::uint16_t>(std::stoi(number));
      const double azimuth = table.optional_number(row, azimuth_column);
      constexpr double kTurn = 2.0 * urban_gnss::kPi;
      satellite.azimuth = static_cast<float>(azimuth - kTurn * std::floor(azimuth / kTurn));
      satellite.elevation = static_cast<float>(table.optional_number(row, elevation_column));
      satellite.cn0 = static_cast<float>(table.optional_number(row, cn0_column));
      satellite.pseudorange_residual = static_cast<float>(table.optional_number(row, residual_column));
      // Where the file does not say whether a satellite was received, nothing speaks against it.
      satellite.tracked = table.text(row, received_column) != "0";
      satellite.used = !satellite.tracked                              ? Satellite::NOT_USED
                       : std::isfinite(satellite.pseudorange_residual) ? Satellite::USED
                                                                       : Satellite::USE_UNKNOWN;
      array.satellites.push_back(satellite);
    }
    contents.add(topics::kSatellites, stamp, array);
  }
}

void add_velocities(const CsvTable& table, BagContents& contents) {
  const auto east = table.column("ve");
  const auto north = table.column("vn");
  const auto up = table.optional_column("vu");
  for (std::size_t row = 0; row < table.size(); ++row) {
    geometry_msgs::TwistWithCovarianceStamped velocity;
    velocity.header.stamp = urban_gnss::to_ros_or_throw(table.stamp(row));
    velocity.header.frame_id = "map";  // a vector is expressed in its frame_id, and these axes are east, north, up
    velocity.twist.twist.linear.x = table.number(row, east);
    velocity.twist.twist.linear.y = table.number(row, north);
    const double climb = table.optional_number(row, up);
    velocity.twist.twist.linear.z = std::isfinite(climb) ? climb : 0.0;
    contents.add(topics::kVelocity, table.stamp(row), velocity);
  }
}

void add_imu(const CsvTable& table, BagContents& contents) {
  const bool has_orientation = table.optional_column("qw") != CsvTable::kAbsent;
  const auto columns = [&](std::initializer_list<const char*> names) {
    std::vector<CsvTable::Column> found;
    for (const char* name : names) found.push_back(table.column(name));
    return found;
  };
  const auto rate = columns({"wx", "wy", "wz"});
  const auto acceleration = columns({"ax", "ay", "az"});
  const auto orientation = has_orientation ? columns({"qx", "qy", "qz", "qw"}) : std::vector<CsvTable::Column>{};
  for (std::size_t row = 0; row < table.size(); ++row) {
    sensor_msgs::Imu imu;
    imu.header.stamp = urban_gnss::to_ros_or_throw(table.stamp(row));
    imu.header.frame_id = "imu_link";
    imu.angular_velocity.x = table.number(row, rate[0]);
    imu.angular_velocity.y = table.number(row, rate[1]);
    imu.angular_velocity.z = table.number(row, rate[2]);
    imu.linear_acceleration.x = table.number(row, acceleration[0]);
    imu.linear_acceleration.y = table.number(row, acceleration[1]);
    imu.linear_acceleration.z = table.number(row, acceleration[2]);
    if (has_orientation) {
      imu.orientation.x = table.number(row, orientation[0]);
      imu.orientation.y = table.number(row, orientation[1]);
      imu.orientation.z = table.number(row, orientation[2]);
      imu.orientation.w = table.number(row, orientation[3]);
    } else {
      imu.orientation.w = 1.0;
      imu.orientation_covariance[0] = -1.0;  // sensor_msgs/Imu: no orientation
    }
    contents.add(topics::kImu, table.stamp(row), imu);
  }
}

void add_truth(const CsvTable& table, BagContents& contents) {
  const auto x = table.column("x");
  const auto y = table.column("y");
  const auto z = table.optional_column("z");
  const auto yaw = table.column("yaw");
  const auto speed = table.optional_column("v");
  const auto or_zero = [](double value) { return std::isfinite(value) ? value : 0.0; };
  for (std::size_t row = 0; row < table.size(); ++row) {
    nav_msgs::Odometry truth;
    truth.header.stamp = urban_gnss::to_ros_or_throw(table.stamp(row));
    truth.header.frame_id = "map";
    truth.child_frame_id = "base_link";
    truth.pose.pose = urban_gnss::to_message(Pose2{table.number(row, x), table.number(row, y), table.number(row, yaw)});
    truth.pose.pose.position.z = or_zero(table.optional_number(row, z));
    truth.twist.twist.linear.x = or_zero(table.optional_number(row, speed));
    contents.add(topics::kTruth, table.stamp(row), truth);
  }
}

using AddTable = void (*)(const CsvTable&, BagContents&);

/// A file that may be missing.
struct OptionalTable {
  const char* name;
  AddTable add;
};
constexpr OptionalTable kOptionalTables[] = {
    {"imu.csv", add_imu}, {"sats.csv", add_satellites}, {"gnss_vel.csv", add_velocities}, {"truth.csv", add_truth}};

void convert(const fs::path& folder, const std::string& gnss_file, const OdometryNoise& noise, const fs::path& output,
             const urban_gnss::InputFiles& inputs) {
  const GeodeticPosition origin = read_origin(folder / "meta.json");
  const CsvTable odometry = read_table(folder / "odom.csv");
  const CsvTable fixes = read_table(folder / gnss_file);
  if (odometry.size() == 0) throw std::runtime_error(odometry.path() + ": has no rows");
  if (fixes.size() == 0) throw std::runtime_error(fixes.path() + ": has no rows");

  std::vector<std::pair<CsvTable, AddTable>> optional_tables;
  for (const OptionalTable& table : kOptionalTables) {
    if (fs::exists(folder / table.name)) optional_tables.emplace_back(read_table(folder / table.name), table.add);
  }

  Stamp start = std::min(odometry.stamp(0), fixes.stamp(0));
  for (const auto& [table, add] : optional_tables) {
    if (table.size() > 0) start = std::min(start, table.stamp(0));
  }

  // The order of these calls is the order of messages with the same stamp: whatever a fix is compared with comes first,
  // and before odometry the yaw rate of its step.
  BagContents contents;
  contents.add(topics::kDatum, start, urban_gnss::to_message(origin, urban_gnss::to_ros_or_throw(start), "map"));
  const auto add_optional = [&](bool is_imu) {
    for (const auto& [table, add] : optional_tables) {
      if ((add == add_imu) == is_imu) add(table, contents);
    }
  };
  add_optional(true);
  add_odometry(odometry, noise, contents);
  add_fixes(fixes, LocalFrame(origin), contents);
  add_optional(false);
  contents.write(output, inputs);
  contents.print_summary(std::cout);
  std::cout << output.string() << ": " << fs::file_size(output) << " bytes\n";
}

}  // namespace

int main(int argc, char** argv) {
  std::string folder;
  std::string output;
  std::string gnss_file = "gnss.csv";
  OdometryNoise noise;
  urban_gnss::CommandLine line("csv_to_bag", "Makes a bag out of a folder of recorded CSV files.");
  line.app()
      .add_option(
          "DIR", folder,
          "folder with meta.json, odom.csv and the fixes; sats.csv, gnss_vel.csv, imu.csv and truth.csv are used "
          "where present")
      ->required();
  line.add_output("OUT", output, "bag to write")->required();
  line.app().add_option("--gnss-file", gnss_file, "file in DIR with the fixes");
  line.app()
      .add_option("--speed-sigma", noise.speed_mps, "declared noise of the odometry's speed, m/s")
      ->check(CLI::Range(1e-6, 1e6));
  line.app()
      .add_option("--speed-share", noise.speed_share, "the same as a share of the speed")
      ->check(CLI::Range(0.0, 1.0));
  line.app()
      .add_option("--yaw-rate-sigma", noise.yaw_rate_rad_s, "declared noise of its yaw rate, rad/s")
      ->check(CLI::Range(1e-6, 1e6));
  return line.run(argc, argv, [&] {
    for (const std::string& name : {std::string("meta.json"), std::string("odom.csv"), gnss_file}) {
      line.reads(fs::path(folder) / name);
    }
    for (const OptionalTable& table : kOptionalTables) line.reads(fs::path(folder) / table.name);
    convert(folder, gnss_file, noise, output, line.inputs());
  });
}
