#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "urban_gnss_localization/common/parameters.hpp"
#include "urban_gnss_localization/common/random.hpp"
#include "urban_gnss_localization/geometry/pose2.hpp"
#include "urban_gnss_localization/simulation/obstacles.hpp"
#include "urban_gnss_localization/simulation/sample_clock.hpp"
#include "urban_gnss_localization/simulation/wall_index.hpp"
#include "urban_gnss_localization/simulation/world.hpp"

namespace urban_gnss {

enum class LidarType {
  kNone,
  kSpinning,    ///< several beams turning about the vertical
  kRotating2d,  ///< a 2-D scanner turned by a motor, as in Maier & Kleiner
};
EnumNames<LidarType> enum_names(LidarType);

/// The axis about which a rotating 2-D scanner is turned: the middle of its fan of 180 degrees lies on it, so that
/// every half turn covers the hemisphere around it.
enum class LidarAxis {
  kVertical,  ///< the sky: from horizon to horizon
  kForward,   ///< what is ahead, ground included; Maier & Kleiner's axis is parallel to the ground
};
EnumNames<LidarAxis> enum_names(LidarAxis);

struct LidarParameters {
  LidarType type{LidarType::kSpinning};
  double rate{10.0};
  int beams{16};
  double vertical_fov_low{-0.26};
  double vertical_fov_high{0.26};
  int points_per_revolution{1875};
  LidarAxis rotation_axis{LidarAxis::kVertical};
  double sweep_time{2.0};
  double line_rate{75.0};
  int rays_per_line{181};
  double range_min{0.5};
  double range_max{80.0};
  double range_sigma{0.02};
  double dropout{0.02};
  double crown_return_share{0.3};
  double mount_x{1.0};
  double mount_y{0.0};
  double mount_z{1.9};
  double body_rear{-0.8};
  double body_front{3.2};
  double body_width{1.7};
  double body_bottom{0.2};
  double body_top{1.5};

  void visit(ParameterVisitor& v) {
    v("type", type, "");
    v("rate", rate, between(0.1, 100.0), "Hz", "revolutions, for spinning");
    v("beams", beams, between(1, 256), "", "for spinning");
    v("vertical_fov_low", vertical_fov_low, between(-1.57, 1.57), "rad", "elevation of the lowest beam, for spinning");
    v("vertical_fov_high", vertical_fov_high, between(-1.57, 1.57), "rad",
      "elevation of the highest beam, for spinning");
    v("points_per_revolution", points_per_revolution, between(1, 100000), "", "of each beam, for spinning");
    v("rotation_axis", rotation_axis, "for rotating_2d");
    v("sweep_time", sweep_time, between(0.01, 60.0), "s",
      "of a half turn, for rotating_2d; Maier & Kleiner turn 90 deg/s");
    v("line_rate", line_rate, between(1.0, 10000.0), "Hz", "fans, for rotating_2d; SICK LMS 200 at 1 degree");
    v("rays_per_line", rays_per_line, between(2, 10000), "", "over 180 degrees, both ends included, for rotating_2d");
    v("range_min", range_min, non_negative(), "m", "nearer surfaces give no point");
    v("range_max", range_max, positive(), "", "m");
    v("range_sigma", range_sigma, non_negative(), "", "m");
    v("dropout", dropout, between(0.0, 1.0), "", "share of returns that are lost");
    v("crown_return_share", crown_return_share, between(0.0, 1.0), "",
      "of the rays that travel a metre through a tree's crown, how many end there");
    v("mount_x", mount_x, any_number(), "m", "sensor in base_link, axes parallel");
    v("mount_y", mount_y, any_number(), "", "");
    v("mount_z", mount_z, positive(), "", "");
    v("body_rear", body_rear, any_number(), "m",
      "box of the robot's body in base_link: x from body_rear to body_front");
    v("body_front", body_front, any_number(), "", "");
    v("body_width", body_width, non_negative(), "m", "about y = 0; 0: no body");
    v("body_bottom", body_bottom, non_negative(), "", "m");
    v("body_top", body_top, non_negative(), "", "m");
  }
  /// The ranges and fields of view in order, at least one line a sweep, the sensor outside the body.
  void check(std::vector<std::string>& faults) const;

  Eigen::Vector3d mount() const { return {mount_x, mount_y, mount_z}; }
};

/// What a ray can end on.
enum class Surface { kGround, kBuilding, kTrunk, kCrown, kCar, kBody };

/// The intensity that a point on such a surface is given, 0 to 255; different for each, the same at every distance.
float intensity(Surface surface);

/// Points in the sensor frame (base_link moved by the mounting), structure of arrays of equal size.
struct LidarScan {
  double stamp_s{0.0};
  std::vector<float> x;  ///< m
  std::vector<float> y;
  std::vector<float> z;
  std::vector<float> intensity;
  std::vector<std::uint16_t> ring;  ///< spinning: beam from the lowest; rotating_2d: ray within the fan

  std::size_t size() const { return x.size(); }
  bool empty() const { return x.empty(); }
  void clear();
  void reserve(std::size_t count);
};

/// A lidar on a planar robot. Rays are cast exactly at the ground (z = 0), buildings, trunks, cars and the robot's own
/// body; in a crown they end at random, with equal chance on every stretch of the way.
class Lidar {
 public:
  /// Keeps references to `world` and `index`, which is built from it. Requires parameters without faults.
  Lidar(const LidarParameters& parameters, const World& world, const WallIndex& index, std::uint64_t seed);

  /// To be called after every simulation step, with poses of base_link in the map and in the odom frame. Whatever fell
  /// due since the last call is cast from poses interpolated between the calls. Returns whether `scan` now holds a new,
  /// complete scan: a spinning lidar's every 1/rate s, cast whole from the pose at its stamp (no motion distortion); a
  /// rotating scanner's at the end of every half turn, each line brought into the sensor frame of that moment by the
  /// odometry's motion, so that odometry's drift smears it as in reality. The first call sets the start only. Steps
  /// longer than a scan give the last scan only.
  bool advance(double time_s, const Pose2& truth, const Pose2& odometry, const std::vector<Car>& cars, LidarScan& scan);

  /// One whole revolution (spinning) or half turn (rotating_2d) from a robot that stands at `truth` (map frame), while
  /// cars are where they are at `time_s`. Nothing for none. Does not disturb a sweep under way, other than by the noise
  /// that it draws.
  void scan(const Pose2& truth, double time_s, const std::vector<Car>& cars, LidarScan& scan);

  const LidarParameters& parameters() const { return parameters_; }
  /// Rays of one scan.
  std::size_t ray_count() const;

 private:
  struct Return {
    double range_m;
    Surface surface;
  };
  struct Ray {
    Eigen::Vector3d direction;  ///< sensor frame
    double azimuth_rad;         ///< sensor frame
    double body_m;              ///< range of the robot's own body, infinite where it is not met
    std::uint16_t ring;
  };
  struct SweepLine {
    std::size_t end;  ///< its points in sweep_ end before this index
    Pose2 odometry;
  };
  static constexpr int kSectors = 256;  ///< of azimuth, map frame

  void add_ray(const Eigen::Vector3d& direction, int ring);
  void add_spinning_rays();
  void add_rotating_rays();
  void look_around(const Pose2& truth, const std::vector<Car>& cars, double time_s);
  void add_to_sectors(int target, const Eigen::Vector2d& centre, double radius_m);
  void cast_rays(std::size_t first, std::size_t count, LidarScan& scan);
  bool cast(const Ray& ray, Return& nearest);
  void end_sweep(double time_s, LidarScan& scan);

  LidarParameters parameters_;
  const World& world_;
  const WallIndex& index_;
  RandomEngine engine_;
  double crown_density_per_m_;  ///< returns on a metre of crown
  std::vector<Ray> rays_;       ///< of a whole scan; line by line for rotating_2d

  // What is in reach of the sensor, as of look_around():
  Pose2 sensor_;
  std::vector<Box> cars_;
  /// For each sector of azimuth, the trees (index into World::trees) and cars (-1 - index into cars_) seen in it.
  std::array<std::vector<int>, kSectors> sectors_;

  // Between the calls of advance():
  SampleClock clock_;
  bool has_started_{false};
  double start_s_{0.0};
  double last_s_{0.0};
  Pose2 last_truth_;
  Pose2 last_odometry_;
  LidarScan sweep_;  ///< points of the sweep under way, each line in the sensor frame of its moment
  std::vector<SweepLine> lines_;
};

}  // namespace urban_gnss
