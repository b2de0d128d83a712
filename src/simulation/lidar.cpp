#include "urban_gnss_localization/simulation/lidar.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>

namespace urban_gnss {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr std::uint64_t kLidarStream = 231;

std::string number(double value) {
  std::ostringstream out;
  out << value;
  return out.str();
}

Pose2 interpolate(const Pose2& a, const Pose2& b, double share) {
  return {a.x + share * (b.x - a.x), a.y + share * (b.y - a.y),
          wrap_angle(a.yaw + share * angle_difference(b.yaw, a.yaw))};
}

int lines_per_sweep(const LidarParameters& p) { return static_cast<int>(std::lround(p.sweep_time * p.line_rate)); }

double sample_rate(const LidarParameters& p) {
  return p.type == LidarType::kRotating2d ? lines_per_sweep(p) / p.sweep_time : p.rate;
}

Box body_box(const LidarParameters& p) {
  Box body;
  body.pose = {0.5 * (p.body_rear + p.body_front), 0.0, 0.0};
  body.length_m = p.body_front - p.body_rear;
  body.width_m = p.body_width;
  body.base_m = p.body_bottom;
  body.top_m = p.body_top;
  return body;
}

bool is_inside(const Eigen::Vector3d& point, const Box& box) {
  const auto interval = intersect(point, Eigen::Vector3d::UnitX(), box);
  return interval && interval->enter_m <= 0.0 && interval->exit_m >= 0.0;
}

}  // namespace

EnumNames<LidarType> enum_names(LidarType) {
  return {{"none", LidarType::kNone}, {"spinning", LidarType::kSpinning}, {"rotating_2d", LidarType::kRotating2d}};
}

EnumNames<LidarAxis> enum_names(LidarAxis) {
  return {{"vertical", LidarAxis::kVertical}, {"forward", LidarAxis::kForward}};
}

void LidarParameters::check(std::vector<std::string>& faults) const {
  if (!(range_min < range_max)) {
    faults.push_back("range_min = " + number(range_min) + ": must be less than range_max = " + number(range_max));
  }
  if (!(vertical_fov_low <= vertical_fov_high)) {
    faults.push_back("vertical_fov_low = " + number(vertical_fov_low) +
                     ": must be at most vertical_fov_high = " + number(vertical_fov_high));
  }
  if (lines_per_sweep(*this) < 1) {
    faults.push_back("line_rate = " + number(line_rate) + ": must give a line in a sweep_time of " +
                     number(sweep_time));
  }
  if (body_width > 0.0) {
    if (!(body_rear < body_front)) {
      faults.push_back("body_rear = " + number(body_rear) + ": must be less than body_front = " + number(body_front));
    }
    if (!(body_bottom < body_top)) {
      faults.push_back("body_bottom = " + number(body_bottom) + ": must be less than body_top = " + number(body_top));
    }
    if (is_inside(mount(), body_box(*this))) {
      faults.push_back("mount_z = " + number(mount_z) + ": the sensor is inside the robot's body");
    }
  }
}

float intensity(Surface surface) {
  switch (surface) {
    case Surface::kGround: return 20.0F;
    case Surface::kBuilding: return 80.0F;
    case Surface::kTrunk: return 50.0F;
    case Surface::kCrown: return 120.0F;
    case Surface::kCar: return 160.0F;
    case Surface::kBody: return 200.0F;
  }
  return 0.0F;
}

void LidarScan::clear() {
  x.clear();
  y.clear();
  z.clear();
  intensity.clear();
  ring.clear();
}

void LidarScan::reserve(std::size_t count) {
  x.reserve(count);
  y.reserve(count);
  z.reserve(count);
  intensity.reserve(count);
  ring.reserve(count);
}

Lidar::Lidar(const LidarParameters& parameters, const World& world, const WallIndex& index, std::uint64_t seed)
    : parameters_(parameters),
      world_(world),
      index_(index),
      engine_(make_engine(seed, kLidarStream)),
      crown_density_per_m_(-std::log1p(-parameters.crown_return_share)),
      clock_(sample_rate(parameters)) {
  if (parameters_.type == LidarType::kSpinning) add_spinning_rays();
  if (parameters_.type == LidarType::kRotating2d) add_rotating_rays();
  sweep_.reserve(rays_.size());
}

void Lidar::add_ray(const Eigen::Vector3d& direction, int ring) {
  Ray ray{direction, std::atan2(direction.y(), direction.x()), kInfinity, static_cast<std::uint16_t>(ring)};
  if (parameters_.body_width > 0.0) {
    const auto body = intersect(parameters_.mount(), direction, body_box(parameters_));
    if (body && body->enter_m > 0.0) ray.body_m = body->enter_m;
  }
  rays_.push_back(ray);
}

void Lidar::add_spinning_rays() {
  const LidarParameters& p = parameters_;
  rays_.reserve(ray_count());
  for (int column = 0; column < p.points_per_revolution; ++column) {
    const double azimuth = 2.0 * kPi * column / p.points_per_revolution;
    for (int beam = 0; beam < p.beams; ++beam) {
      const double share = p.beams > 1 ? static_cast<double>(beam) / (p.beams - 1) : 0.5;
      const double elevation = p.vertical_fov_low + share * (p.vertical_fov_high - p.vertical_fov_low);
      add_ray({std::cos(elevation) * std::cos(azimuth), std::cos(elevation) * std::sin(azimuth), std::sin(elevation)},
              beam);
    }
  }
}

void Lidar::add_rotating_rays() {
  const LidarParameters& p = parameters_;
  rays_.reserve(ray_count());
  const bool is_vertical = p.rotation_axis == LidarAxis::kVertical;
  const Eigen::Vector3d axis = is_vertical ? Eigen::Vector3d::UnitZ() : Eigen::Vector3d::UnitX();
  const Eigen::Vector3d first = is_vertical ? Eigen::Vector3d::UnitX() : Eigen::Vector3d::UnitY();
  const Eigen::Vector3d second = is_vertical ? Eigen::Vector3d::UnitY() : Eigen::Vector3d::UnitZ();
  const int lines = lines_per_sweep(p);
  for (int line = 0; line < lines; ++line) {
    const double turned = kPi * (line + 1) / lines;
    const Eigen::Vector3d side = std::cos(turned) * first + std::sin(turned) * second;
    for (int i = 0; i < p.rays_per_line; ++i) {
      const double from_axis = kPi * (static_cast<double>(i) / (p.rays_per_line - 1) - 0.5);
      add_ray(std::cos(from_axis) * axis + std::sin(from_axis) * side, i);
    }
  }
}

std::size_t Lidar::ray_count() const {
  const LidarParameters& p = parameters_;
  if (p.type == LidarType::kSpinning) return static_cast<std::size_t>(p.beams) * p.points_per_revolution;
  if (p.type == LidarType::kRotating2d) return static_cast<std::size_t>(lines_per_sweep(p)) * p.rays_per_line;
  return 0;
}

void Lidar::scan(const Pose2& truth, double time_s, const std::vector<Car>& cars, LidarScan& scan) {
  scan.clear();
  scan.reserve(rays_.size());
  scan.stamp_s = time_s;
  if (rays_.empty()) return;
  look_around(truth, cars, time_s);
  cast_rays(0, rays_.size(), scan);
}

bool Lidar::advance(double time_s, const Pose2& truth, const Pose2& odometry, const std::vector<Car>& cars,
                    LidarScan& scan) {
  if (rays_.empty()) return false;
  bool is_complete = false;
  if (!has_started_) {
    has_started_ = true;
    start_s_ = time_s;
  }
  const std::size_t lines = static_cast<std::size_t>(lines_per_sweep(parameters_));
  const std::size_t line_rays = static_cast<std::size_t>(parameters_.rays_per_line);
  for (; clock_.is_due(time_s - start_s_); clock_.advance()) {
    const double due_s = start_s_ + clock_.due_s();
    const double share = std::clamp((due_s - last_s_) / (time_s - last_s_), 0.0, 1.0);
    const Pose2 due_truth = interpolate(last_truth_, truth, share);
    if (parameters_.type == LidarType::kSpinning) {
      is_complete = true;
      this->scan(due_truth, due_s, cars, scan);
      continue;
    }
    look_around(due_truth, cars, due_s);
    cast_rays(lines_.size() * line_rays, line_rays, sweep_);
    lines_.push_back({sweep_.size(), interpolate(last_odometry_, odometry, share)});
    if (lines_.size() == lines) {
      is_complete = true;
      end_sweep(due_s, scan);
    }
  }
  last_s_ = time_s;
  last_truth_ = truth;
  last_odometry_ = odometry;
  return is_complete;
}

void Lidar::end_sweep(double time_s, LidarScan& scan) {
  const Pose2 mount{parameters_.mount_x, parameters_.mount_y, 0.0};
  const Pose2 end = compose(lines_.back().odometry, mount);
  std::size_t i = 0;
  for (const SweepLine& line : lines_) {
    const Pose2 to_end = relative_pose(end, compose(line.odometry, mount));
    const double c = std::cos(to_end.yaw);
    const double s = std::sin(to_end.yaw);
    for (; i < line.end; ++i) {
      const double x = sweep_.x[i];
      const double y = sweep_.y[i];
      sweep_.x[i] = static_cast<float>(to_end.x + c * x - s * y);
      sweep_.y[i] = static_cast<float>(to_end.y + s * x + c * y);
    }
  }
  sweep_.stamp_s = time_s;
  scan = sweep_;
  sweep_.clear();
  lines_.clear();
}

void Lidar::look_around(const Pose2& truth, const std::vector<Car>& cars, double time_s) {
  sensor_ = compose(truth, {parameters_.mount_x, parameters_.mount_y, 0.0});
  for (auto& sector : sectors_) sector.clear();
  for (std::size_t i = 0; i < world_.trees.size(); ++i) {
    const Tree& tree = world_.trees[i];
    add_to_sectors(static_cast<int>(i), tree.position, std::max(tree.crown_radius_m, tree.trunk_radius_m));
  }
  cars_.clear();
  for (const Car& car : cars) {
    const Box box = car.at(time_s);
    add_to_sectors(-1 - static_cast<int>(cars_.size()), box.pose.position(),
                   0.5 * std::hypot(box.length_m, box.width_m));
    cars_.push_back(box);
  }
}

void Lidar::add_to_sectors(int target, const Eigen::Vector2d& centre, double radius_m) {
  const Eigen::Vector2d to_centre = centre - sensor_.position();
  const double distance = to_centre.norm();
  if (distance - radius_m > parameters_.range_max) return;
  if (distance <= radius_m) {
    for (auto& sector : sectors_) sector.push_back(target);
    return;
  }
  // A little wider than seen, so that rounding does not lose a ray that touches it.
  const double half = std::asin(radius_m / distance) + 1e-6;
  const double azimuth = std::atan2(to_centre.y(), to_centre.x());
  const double sectors_per_rad = kSectors / (2.0 * kPi);
  const int first = static_cast<int>(std::floor((azimuth - half) * sectors_per_rad));
  const int last = static_cast<int>(std::floor((azimuth + half) * sectors_per_rad));
  for (int i = first; i <= last; ++i)
    sectors_[static_cast<std::size_t>((i + 2 * kSectors) % kSectors)].push_back(target);
}

void Lidar::cast_rays(std::size_t first, std::size_t count, LidarScan& scan) {
  const LidarParameters& p = parameters_;
  for (std::size_t i = first; i < first + count; ++i) {
    const Ray& ray = rays_[i];
    Return nearest;
    if (!cast(ray, nearest) || nearest.range_m < p.range_min) continue;
    if (draw_uniform(engine_) < p.dropout) continue;
    const double range = std::max(nearest.range_m + p.range_sigma * draw_normal(engine_), 0.0);
    scan.x.push_back(static_cast<float>(range * ray.direction.x()));
    scan.y.push_back(static_cast<float>(range * ray.direction.y()));
    scan.z.push_back(static_cast<float>(range * ray.direction.z()));
    scan.intensity.push_back(intensity(nearest.surface));
    scan.ring.push_back(ray.ring);
  }
}

bool Lidar::cast(const Ray& ray, Return& nearest) {
  // Nothing can be between the sensor and the robot's own body.
  if (ray.body_m <= parameters_.range_max) {
    nearest = {ray.body_m, Surface::kBody};
    return true;
  }
  const Eigen::Vector3d origin(sensor_.x, sensor_.y, parameters_.mount_z);
  const double c = std::cos(sensor_.yaw);
  const double s = std::sin(sensor_.yaw);
  const Eigen::Vector3d& d = ray.direction;
  const Eigen::Vector3d direction(c * d.x() - s * d.y(), s * d.x() + c * d.y(), d.z());

  nearest.range_m = parameters_.range_max;
  bool is_hit = false;
  const auto offer = [&](double range_m, Surface surface) {
    if (range_m < 0.0 || range_m > nearest.range_m) return;
    nearest = {range_m, surface};
    is_hit = true;
  };
  if (direction.z() < 0.0) offer(-origin.z() / direction.z(), Surface::kGround);

  const double turns = (ray.azimuth_rad + sensor_.yaw) / (2.0 * kPi);
  const int sector_index = static_cast<int>((turns - std::floor(turns)) * kSectors) % kSectors;
  const std::vector<int>& sector = sectors_[static_cast<std::size_t>(sector_index)];
  for (const int target : sector) {
    if (target < 0) {
      const auto car = intersect(origin, direction, cars_[static_cast<std::size_t>(-1 - target)]);
      if (car) offer(car->enter_m, Surface::kCar);
    } else {
      const Tree& tree = world_.trees[static_cast<std::size_t>(target)];
      const auto trunk =
          intersect_cylinder(origin, direction, tree.position, tree.trunk_radius_m, 0.0, tree.crown_base_m);
      if (trunk) offer(trunk->enter_m, Surface::kTrunk);
    }
  }
  if (const auto wall = index_.cast(origin, direction, nearest.range_m)) offer(wall->range_m, Surface::kBuilding);

  if (!(crown_density_per_m_ > 0.0)) return is_hit;
  for (const int target : sector) {
    if (target < 0) continue;
    const Tree& tree = world_.trees[static_cast<std::size_t>(target)];
    const auto crown =
        intersect_cylinder(origin, direction, tree.position, tree.crown_radius_m, tree.crown_base_m, tree.crown_top_m);
    if (!crown || crown->exit_m < 0.0 || crown->enter_m > nearest.range_m) continue;
    const double free_path = -std::log1p(-draw_uniform(engine_)) / crown_density_per_m_;
    const double range = std::max(crown->enter_m, 0.0) + free_path;
    if (range <= crown->exit_m) offer(range, Surface::kCrown);
  }
  return is_hit;
}

}  // namespace urban_gnss
