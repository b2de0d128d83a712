#include "urban_gnss_localization/simulation/wall_index.hpp"

#include <algorithm>
#include <cmath>

namespace urban_gnss {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
/// m: a face nearer than this is the one that the ray starts on; a ray that passes a wall's end by less does not slip
/// through the corner.
constexpr double kTouching = 1e-9;
/// m: a wall is listed in the cells that it passes this near by, far above the rounding of the walk.
constexpr double kCellMargin = 1e-6;
constexpr double kCellSize = 8.0;        // m
constexpr int kMostCellsPerSide = 1024;  // what bounds the memory where two buildings are 100 km apart

double cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); }

}  // namespace

WallIndex::WallIndex(const World& world) {
  for (std::size_t i = 0; i < world.buildings.size(); ++i) add(world.buildings[i], static_cast<int>(i));
  const auto is_lower = [](const Face& a, const Face& b) { return a.height_m < b.height_m; };
  std::stable_sort(roofs_.begin(), roofs_.end(), is_lower);
  std::stable_sort(undersides_.begin(), undersides_.end(), is_lower);
  build_grid();
}

void WallIndex::add(const Building& building, int index) {
  Block block{counter_clockwise(building.footprint), Eigen::Vector2d::Constant(kInfinity),
              Eigen::Vector2d::Constant(-kInfinity), building.base_m, building.roof_m};
  for (std::size_t i = 0; i < block.footprint.size(); ++i) {
    Wall wall;
    wall.from = block.footprint[i];
    wall.to = block.footprint[(i + 1) % block.footprint.size()];
    const Eigen::Vector2d edge = wall.to - wall.from;
    wall.normal = Eigen::Vector2d(edge.y(), -edge.x()).normalized();
    wall.base_m = building.base_m;
    wall.roof_m = building.roof_m;
    wall.reflection_loss_db = building.reflection_loss_db;
    wall.building = index;
    walls_.push_back(wall);
    segments_.push_back({wall.from, edge, kTouching / edge.norm(), building.base_m, building.roof_m});
    block.low = block.low.cwiseMin(wall.from);
    block.high = block.high.cwiseMax(wall.from);
  }
  roofs_.push_back({building.roof_m, index});
  if (building.base_m > 0.0) undersides_.push_back({building.base_m, index});
  lowest_base_m_ = std::min(lowest_base_m_, building.base_m);
  highest_roof_m_ = std::max(highest_roof_m_, building.roof_m);
  blocks_.push_back(std::move(block));
}

void WallIndex::build_grid() {
  if (walls_.empty()) return;
  Eigen::Vector2d low = Eigen::Vector2d::Constant(kInfinity);
  Eigen::Vector2d high = -low;
  for (const Block& block : blocks_) {
    low = low.cwiseMin(block.low);
    high = high.cwiseMax(block.high);
  }
  grid_low_ = low.array() - kCellMargin;
  const Eigen::Array2d extent = (high - grid_low_).array() + kCellMargin;
  cell_size_m_ = std::max(kCellSize, extent.maxCoeff() / kMostCellsPerSide);
  cell_count_ = (extent / cell_size_m_).ceil().cast<int>().max(1);

  const auto for_each_cell = [this](const Wall& wall, const auto& visit) {
    const auto cell_of = [this](const Eigen::Array2d& point) -> Eigen::Array2i {
      const Eigen::Array2i cell = ((point - grid_low_.array()) / cell_size_m_).floor().cast<int>();
      return cell.max(0).min(cell_count_ - 1);
    };
    const Eigen::Array2i first = cell_of(wall.from.cwiseMin(wall.to).array() - kCellMargin);
    const Eigen::Array2i last = cell_of(wall.from.cwiseMax(wall.to).array() + kCellMargin);
    // Half the cell's extent along the wall's normal: the wall's line is farther from the centre of a cell beside it.
    const double reach = 0.5 * cell_size_m_ * wall.normal.lpNorm<1>() + kCellMargin;
    for (int row = first.y(); row <= last.y(); ++row) {
      for (int column = first.x(); column <= last.x(); ++column) {
        const Eigen::Vector2d centre = grid_low_ + cell_size_m_ * Eigen::Vector2d(column + 0.5, row + 0.5);
        if (std::abs(wall.normal.dot(centre - wall.from)) <= reach) visit(row * cell_count_.x() + column);
      }
    }
  };
  // A counting sort of the walls by cell: how many, then where each cell's part begins, then the walls.
  cell_start_.assign(static_cast<std::size_t>(cell_count_.prod()) + 1, 0);
  for (const Wall& wall : walls_) for_each_cell(wall, [this](int cell) { ++cell_start_[cell + 1]; });
  for (std::size_t i = 1; i < cell_start_.size(); ++i) cell_start_[i] += cell_start_[i - 1];
  cell_walls_.resize(cell_start_.back());
  std::vector<std::uint32_t> next(cell_start_.begin(), cell_start_.end() - 1);
  for (std::size_t i = 0; i < walls_.size(); ++i) {
    for_each_cell(walls_[i], [&](int cell) { cell_walls_[next[cell]++] = static_cast<int>(i); });
  }
}

/// Where origin + range * direction is on the segment; negative where it is not. Not normalised: the range is in
/// multiples of the direction.
inline double WallIndex::range_to(const Segment& segment, const Eigen::Vector2d& origin,
                                  const Eigen::Vector2d& direction) {
  const Eigen::Vector2d offset = segment.from - origin;
  double denominator = cross(direction, segment.edge);
  double along_edge = cross(offset, direction);
  double along_ray = cross(offset, segment.edge);
  if (denominator < 0.0) {
    denominator = -denominator;
    along_edge = -along_edge;
    along_ray = -along_ray;
  }
  // A ray along the wall meets the walls at its ends.
  const double slack = segment.end_tolerance * denominator;
  if (denominator == 0.0 || along_edge < -slack || along_edge > denominator + slack) return -1.0;
  return along_ray / denominator;
}

/// Calls visit(wall) for the walls listed in the cells that the ray passes, in its order, a wall several times where it
/// is listed in several. `visit` may lower `limit`, the range at which the walk ends.
template <class Visit>
void WallIndex::walk(const Eigen::Vector2d& origin, const Eigen::Vector2d& direction, const double& limit,
                     const Visit& visit) const {
  if (walls_.empty()) return;
  double entry = 0.0;
  double exit = limit;
  for (int axis = 0; axis < 2; ++axis) {
    const double low = grid_low_[axis];
    const double high = low + cell_size_m_ * cell_count_[axis];
    if (direction[axis] == 0.0) {
      if (origin[axis] < low || origin[axis] > high) return;
      continue;
    }
    const double to_low = (low - origin[axis]) / direction[axis];
    const double to_high = (high - origin[axis]) / direction[axis];
    entry = std::max(entry, std::min(to_low, to_high));
    exit = std::min(exit, std::max(to_low, to_high));
  }
  if (!(entry <= exit)) return;

  int cell[2];
  int step[2];
  double next[2];                             // range of the border to the next cell
  double stride[2] = {kInfinity, kInfinity};  // range from border to border
  for (int axis = 0; axis < 2; ++axis) {
    const double place = (origin[axis] + entry * direction[axis] - grid_low_[axis]) / cell_size_m_;
    cell[axis] = std::clamp(static_cast<int>(std::floor(place)), 0, cell_count_[axis] - 1);
    step[axis] = direction[axis] < 0.0 ? -1 : 1;
    next[axis] = kInfinity;
    if (direction[axis] == 0.0) continue;
    const double border = grid_low_[axis] + cell_size_m_ * (cell[axis] + (step[axis] > 0 ? 1 : 0));
    next[axis] = (border - origin[axis]) / direction[axis];
    stride[axis] = cell_size_m_ / std::abs(direction[axis]);
  }
  for (;;) {
    const int index = cell[1] * cell_count_[0] + cell[0];
    for (std::uint32_t i = cell_start_[index]; i < cell_start_[index + 1]; ++i) visit(cell_walls_[i]);
    const int axis = next[0] < next[1] ? 0 : 1;
    if (next[axis] > limit) return;
    cell[axis] += step[axis];
    if (cell[axis] < 0 || cell[axis] >= cell_count_[axis]) return;
    next[axis] += stride[axis];
  }
}

void WallIndex::cast_at_walls(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, Hit& nearest) const {
  const Eigen::Vector2d start = origin.head<2>();
  const Eigen::Vector2d horizontal = direction.head<2>();
  if (horizontal.squaredNorm() < 1e-24) return;  // stays within a micrometre of the vertical over 1000 km
  // Behind where the ray leaves the heights that have walls there is nothing to find.
  double limit = nearest.range_m;
  if (direction.z() > 0.0) limit = std::min(limit, (highest_roof_m_ - origin.z()) / direction.z());
  if (direction.z() < 0.0) limit = std::min(limit, (lowest_base_m_ - origin.z()) / direction.z());
  walk(start, horizontal, limit, [&](int index) {
    const Segment& segment = segments_[index];
    const double range = range_to(segment, start, horizontal);
    if (!(range > kTouching) || range > nearest.range_m) return;
    const double height = origin.z() + range * direction.z();
    if (height < segment.base_m || height > segment.roof_m) return;
    nearest = {range, index, walls_[index].building};
    limit = std::min(limit, range);
  });
}

void WallIndex::cast_at_faces(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, Hit& nearest) const {
  const auto meets = [&](const Face& face) {
    const double range = (face.height_m - origin.z()) / direction.z();
    if (!(range > kTouching)) return false;
    if (range > nearest.range_m) return true;  // as are all behind it
    const Eigen::Vector2d point = origin.head<2>() + range * direction.head<2>();
    if (!blocks_[face.building].covers(point)) return false;
    nearest = {range, kHorizontalFace, face.building};
    return true;
  };
  if (direction.z() < 0.0) {
    const auto first =
        std::find_if(roofs_.begin(), roofs_.end(), [&](const Face& f) { return f.height_m >= origin.z(); });
    std::find_if(std::make_reverse_iterator(first), roofs_.rend(), meets);
  } else if (direction.z() > 0.0) {
    std::find_if(undersides_.begin(), undersides_.end(), meets);
  }
}

std::optional<WallIndex::Hit> WallIndex::cast(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction,
                                              double max_range_m) const {
  if (!(origin.allFinite() && direction.allFinite() && max_range_m >= 0.0)) return std::nullopt;
  constexpr int kNoBuilding = -1;
  Hit nearest{max_range_m, kHorizontalFace, kNoBuilding};
  cast_at_faces(origin, direction, nearest);
  cast_at_walls(origin, direction, nearest);
  if (nearest.building == kNoBuilding) return std::nullopt;
  return nearest;
}

void WallIndex::crossings(const Eigen::Vector2d& origin, const Eigen::Vector2d& direction, double max_distance_m,
                          std::vector<Crossing>& crossings) const {
  crossings.clear();
  if (!(origin.allFinite() && direction.allFinite() && max_distance_m >= 0.0) || direction.isZero(0.0)) return;
  walk(origin, direction, max_distance_m, [&](int index) {
    const double distance = range_to(segments_[index], origin, direction);
    if (distance > kTouching && distance <= max_distance_m) crossings.push_back({distance, index});
  });
  std::sort(crossings.begin(), crossings.end(), [](const Crossing& a, const Crossing& b) {
    return a.distance_m != b.distance_m ? a.distance_m < b.distance_m : a.wall < b.wall;
  });
  // A wall's crossings from several cells are the same to the bit, so that they are neighbours now.
  const auto is_same = [](const Crossing& a, const Crossing& b) { return a.wall == b.wall; };
  crossings.erase(std::unique(crossings.begin(), crossings.end(), is_same), crossings.end());
}

bool WallIndex::Block::covers(const Eigen::Vector2d& point) const {
  return (point.array() >= low.array()).all() && (point.array() <= high.array()).all() && contains(footprint, point);
}

std::optional<int> WallIndex::building_at(const Eigen::Vector3d& point) const {
  for (std::size_t i = 0; i < blocks_.size(); ++i) {
    const Block& block = blocks_[i];
    if (point.z() < block.base_m || point.z() > block.roof_m || !block.covers(point.head<2>())) continue;
    return static_cast<int>(i);
  }
  return std::nullopt;
}

}  // namespace urban_gnss
