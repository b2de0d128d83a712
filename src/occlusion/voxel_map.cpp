#include "urban_gnss_localization/occlusion/voxel_map.hpp"

#include <algorithm>
#include <cmath>

#include "urban_gnss_localization/common/vector_math.hpp"

namespace urban_gnss {

/// A few points that are added together, and where they are in the map.
struct PointBatch {
  static constexpr std::size_t kSize = 32;

  std::size_t count{0};
  alignas(64) std::array<float, kSize> x, y, z;  ///< m
  alignas(64) std::array<std::int32_t, kSize> voxel_x, voxel_y, voxel_z;
  alignas(64) std::array<std::uint32_t, kSize> in_cell;   ///< cell_bits::place_of() the voxel
  alignas(64) std::array<std::uint32_t, kSize> in_brick;  ///< and its cell
  std::array<KeyIndex::Index, kSize> cell;                ///< kNone where there is no brick yet
  std::array<KeyIndex::Index, kSize> voxel;               ///< kNone where it is not there yet

  VoxelCoordinates coordinates(std::size_t i) const { return {voxel_x[i], voxel_y[i], voxel_z[i]}; }
};

namespace {

/// In voxel edges: nearer than this a followed ray meets a voxel's mean. The same for those that end there and those
/// that go on, so that it leaves their ratio alone.
constexpr double kMeetingDistance = 0.35;

/// The window's border is attended to after each such share of it.
constexpr double kDropInterval = 0.05;

/// Beyond max_voxels so much more is dropped, so that it does not happen at every scan.
constexpr double kLimitReserve = 0.1;

static_assert(VoxelMap::kCellVoxels == 4 && VoxelMap::kBrickCells == 4);

URBAN_GNSS_INLINE std::uint32_t interleaved(std::int32_t x, std::int32_t y, std::int32_t z) {
  return static_cast<std::uint32_t>((x & 1) | (y & 1) << 1 | (z & 1) << 2 | (x & 2) << 2 | (y & 2) << 3 | (z & 2) << 4);
}

/// Places all of a batch, whether used or not: the points' voxels, and the places in cell and brick.
URBAN_GNSS_VECTORISED void place_all(PointBatch& batch, double inverse_voxel) {
  for (std::size_t i = 0; i < PointBatch::kSize; ++i) {
    const std::int32_t x = floor_to_int(batch.x[i] * inverse_voxel);
    const std::int32_t y = floor_to_int(batch.y[i] * inverse_voxel);
    const std::int32_t z = floor_to_int(batch.z[i] * inverse_voxel);
    batch.voxel_x[i] = x;
    batch.voxel_y[i] = y;
    batch.voxel_z[i] = z;
    batch.in_cell[i] = interleaved(x, y, z);
    batch.in_brick[i] = interleaved(x >> 2, y >> 2, z >> 2);
  }
}

/// Calls visit(dx, dy, dz) for a cell and its neighbours.
template <class Visit>
void for_each_nearby(Visit&& visit) {
  for (int x = -1; x <= 1; ++x) {
    for (int y = -1; y <= 1; ++y) {
      for (int z = -1; z <= 1; ++z) visit(x, y, z);
    }
  }
}

}  // namespace

VoxelMap::VoxelMap(const VoxelMapParameters& parameters)
    : parameters_(parameters),
      inverse_voxel_(1.0 / parameters.voxel_size),
      cell_edge_m_(kCellVoxels * parameters.voxel_size),
      // Some cells less than the keys allow, so that neighbours of cells have keys, too. 100 km is far from any datum.
      farthest_m_(static_cast<float>(std::min(1e5, (kMaxVoxelCoordinate - 100) * parameters.voxel_size))),
      observed_(parameters.observed_cell) {
  require_usable("voxel map", parameters);
}

void VoxelMap::clear() { *this = VoxelMap(parameters_); }

InsertReport VoxelMap::add_scan(const PointCloud& points, const Eigen::Vector3d& sensor) {
  InsertReport report;
  report.points = points.size();
  if (!sensor.allFinite() || sensor.cwiseAbs().maxCoeff() > farthest_m_) {
    report.unusable = points.size();
    return report;
  }
  add_points_of(points, report);
  // The phase runs on from scan to scan, so that it is not always the same beams that are followed.
  const auto stride = static_cast<std::size_t>(parameters_.ray_stride);
  for (std::size_t i = ray_phase_ % stride; i < points.size(); i += stride) {
    if (is_usable(points[i])) follow_ray(sensor, points[i].cast<double>());
  }
  ray_phase_ = (ray_phase_ + 7) % stride;
  if (!((sensor - last_drop_).norm() < kDropInterval * parameters_.window)) {
    report.dropped_by_window = drop_beyond(sensor, parameters_.window);
    observed_.drop_beyond(sensor, parameters_.window);
    last_drop_ = sensor;
  }
  report.dropped_by_limit = limit_size(sensor);
  return report;
}

InsertReport VoxelMap::add_points(const PointCloud& points) {
  InsertReport report;
  report.points = points.size();
  add_points_of(points, report);
  if (!bounds_.isEmpty()) report.dropped_by_limit = limit_size(bounds_.center());
  return report;
}

/// In several goes through a few points at a time, each of which asks for the memory of the next: so the points wait
/// for memory together.
void VoxelMap::add_points_of(const PointCloud& points, InsertReport& report) {
  PointBatch batch{};
  BrickCursor cursor;
  for (std::size_t next = 0; next < points.size();) {
    for (batch.count = 0; batch.count < PointBatch::kSize && next < points.size(); ++next) {
      const Eigen::Vector3f& point = points[next];
      if (!is_usable(point)) {
        ++report.unusable;
        continue;
      }
      batch.x[batch.count] = point.x();
      batch.y[batch.count] = point.y();
      batch.z[batch.count] = point.z();
      ++batch.count;
    }
    add_batch(batch, cursor, report);
  }
}

void VoxelMap::add_batch(PointBatch& batch, BrickCursor& cursor, InsertReport& report) {
  place_all(batch, inverse_voxel_);
  for (std::size_t i = 0; i < batch.count; ++i) {
    const Index brick = find_brick(brick_of(cell_of(batch.coordinates(i))), cursor);
    batch.cell[i] = brick == kNone ? kNone : kPlaces * brick + batch.in_brick[i];
    if (brick != kNone) __builtin_prefetch(&cells_[batch.cell[i]]);
  }
  const auto find = [&](std::size_t i) {
    return batch.cell[i] == kNone ? kNone : find_voxel(batch.cell[i], std::uint64_t{1} << batch.in_cell[i]);
  };
  bool is_any_new = false;
  for (std::size_t i = 0; i < batch.count; ++i) {
    const Index voxel = batch.voxel[i] = find(i);
    is_any_new = is_any_new || voxel == kNone;
    if (voxel == kNone) continue;
    __builtin_prefetch(surface_.data() + voxel, 1);
    __builtin_prefetch(counts_.data() + voxel, 1);
  }
  for (std::size_t i = 0; i < batch.count; ++i) {
    const Eigen::Vector3f point(batch.x[i], batch.y[i], batch.z[i]);
    const Index voxel = is_any_new ? find(i) : batch.voxel[i];  // a new one moves others
    if (voxel != kNone) {
      add_to(voxel, point);
      continue;
    }
    add_to_new_voxel(point, batch.coordinates(i), report);
    cursor = {};
  }
}

/// The mean follows at least every thousandth return, so that an old voxel is not deaf.
void VoxelMap::add_to(Index voxel, const Eigen::Vector3f& point) {
  const std::uint32_t count = std::min(++counts_[voxel].returns, 1000U);
  surface_[voxel].mean += (point - surface_[voxel].mean) / static_cast<float>(count);
}

/// Adds to the voxel of a point that was not there a moment ago, but may be by now.
void VoxelMap::add_to_new_voxel(const Eigen::Vector3f& point, const VoxelCoordinates& coordinates,
                                InsertReport& report) {
  if (const Index voxel = find_voxel(coordinates); voxel != kNone) return add_to(voxel, point);
  ++report.new_voxels;
  add_voxel(point, coordinates);
}

void VoxelMap::add_voxel(const Eigen::Vector3f& point, const VoxelCoordinates& coordinates) {
  ++size_;
  bounds_.extend(point.cast<double>());
  const std::uint64_t bit = cell_bits::bit_of(coordinates);
  const VoxelCoordinates cell_coordinates = cell_of(coordinates);
  const Index found = find_cell(cell_coordinates);
  const Index cell = found != kNone && cells_[found].mask != 0 ? found : occupy(cell_coordinates);
  Cell& block = cells_[cell];
  if (block.count == 0 || block.count == room(block.size_class)) {
    const std::size_t size_class = block.count == 0 ? 0 : block.size_class + 1U;
    const Index begin = take_block(size_class);
    for (Index i = 0; i < block.count; ++i) copy_voxel(block.begin + i, begin + i);
    if (block.count > 0) unused_blocks_[block.size_class].push_back(block.begin);
    block.begin = begin;
    block.size_class = static_cast<std::uint8_t>(size_class);
  }
  const Index voxel = block.begin + cell_bits::rank(block.mask, bit);
  for (Index i = block.begin + block.count; i > voxel; --i) copy_voxel(i - 1, i);
  surface_[voxel] = {point, 0.0F};
  counts_[voxel] = {1, 0, 0};
  block.mask |= bit;
  ++block.count;
}

VoxelMap::Index VoxelMap::find_or_add_brick(const VoxelCoordinates& coordinates) {
  const auto fresh = unused_bricks_.empty() ? static_cast<Index>(near_.size()) : unused_bricks_.back();
  const Index brick = brick_index_.find_or_insert(voxel_key(coordinates), fresh);
  if (brick != fresh) return brick;
  if (unused_bricks_.empty()) {
    near_.push_back(0);
    const std::size_t size = kPlaces * near_.size();
    nearby_.resize(size);
    cells_.resize(size);
  } else {
    unused_bricks_.pop_back();
  }
  return brick;
}

VoxelMap::Index VoxelMap::occupy(const VoxelCoordinates& center) {
  for_each_nearby([&](int x, int y, int z) {
    const VoxelCoordinates neighbour = center + VoxelCoordinates(x, y, z);
    const Index brick = find_or_add_brick(brick_of(neighbour));
    const Index place = cell_bits::place_of(neighbour);
    near_[brick] |= std::uint64_t{1} << place;
    nearby_[kPlaces * brick + place] |= cell_bits::nearby_bit(-x, -y, -z);
  });
  return find_cell(center);
}

void VoxelMap::release(const VoxelCoordinates& center) {
  for_each_nearby([&](int x, int y, int z) {
    const VoxelCoordinates neighbour = center + VoxelCoordinates(x, y, z);
    const auto key = voxel_key(brick_of(neighbour));
    const Index brick = brick_index_.find(key);
    const Index place = cell_bits::place_of(neighbour);
    std::uint32_t& nearby = nearby_[kPlaces * brick + place];
    nearby &= ~cell_bits::nearby_bit(-x, -y, -z);
    if (nearby != 0) return;
    near_[brick] &= ~(std::uint64_t{1} << place);
    if (near_[brick] != 0) return;
    brick_index_.erase(key);
    unused_bricks_.push_back(brick);
  });
}

VoxelMap::Index VoxelMap::take_block(std::size_t size_class) {
  auto& unused = unused_blocks_[size_class];
  if (!unused.empty()) {
    const Index begin = unused.back();
    unused.pop_back();
    return begin;
  }
  const std::size_t begin = surface_.size();
  const std::size_t size = begin + room(size_class);
  surface_.resize(size);
  counts_.resize(size);
  return static_cast<Index>(begin);
}

void VoxelMap::copy_voxel(Index from, Index to) {
  surface_[to] = surface_[from];
  counts_[to] = counts_[from];
}

void VoxelMap::follow_ray(const Eigen::Vector3d& sensor, const Eigen::Vector3d& end) {
  observed_.mark(sensor, end);
  const double length_m = (end - sensor).norm();
  if (length_m < parameters_.voxel_size) return;
  const Eigen::Vector3d direction = (end - sensor) / length_m;
  const double meeting_m = kMeetingDistance * parameters_.voxel_size;
  const auto meets = [&](Index voxel) {
    return surface_[voxel].mean.cast<double>().cwiseEqual(end).all() ||
           direction.cross(surface_[voxel].mean.cast<double>() - sensor).squaredNorm() < meeting_m * meeting_m;
  };
  const Index last = find_voxel(voxel_of(end, inverse_voxel_));
  if (last != kNone && meets(last)) count_meeting(last, &Counts::hits);
  // Up to shortly before the return: noise of the range must not make a wall's own returns pass through it.
  const double pass_end_m = length_m - 2.0 * parameters_.voxel_size;
  const GridRay by_voxel(sensor, direction, parameters_.voxel_size);
  VoxelCoordinates first = VoxelCoordinates::Constant(1 << 30);  // cell of the brick, far off before there is one
  Index brick = kNone;
  std::uint64_t near = 0;
  const auto pass_cell = [&](const VoxelCoordinates& cell, double from_m, double to_m) {
    if (!is_in_brick(cell, first)) {
      const VoxelCoordinates at = brick_of(cell);
      first = kBrickCells * at;
      brick = find_brick(at);
      near = brick == kNone ? 0 : near_[brick];
    }
    const Index place_in_brick = cell_bits::place_of(cell);
    if ((near >> place_in_brick & 1U) == 0) return true;
    const Index place = kPlaces * brick + place_in_brick;
    if (cells_[place].mask == 0) return true;
    by_voxel.walk(from_m, to_m, [&](const VoxelCoordinates& coordinates, double, double) {
      Index voxel = kNone;
      if (cell_of(coordinates) != cell) {
        voxel = find_voxel(coordinates);  // on the border rounding may lead into the next cell
      } else {
        voxel = find_voxel(place, cell_bits::bit_of(coordinates));
      }
      if (voxel != kNone && voxel != last && meets(voxel)) count_meeting(voxel, &Counts::passes);
      return true;
    });
    return true;
  };
  GridRay(sensor, direction, cell_edge_m_).walk(0.0, pass_end_m, pass_cell);
}

void VoxelMap::count_meeting(Index voxel, std::uint32_t Counts::*kind) {
  Counts& counts = counts_[voxel];
  ++(counts.*kind);
  const std::uint32_t met = counts.passes + counts.hits;
  if (met >= kMinEvidence) {
    surface_[voxel].permeability = static_cast<float>(counts.passes) / static_cast<float>(met);
  }
}

template <class Visit>
void VoxelMap::for_each_voxel(Visit&& visit) const {
  for (const Cell& block : cells_) {
    for (Index voxel = block.begin; voxel != block.begin + block.count; ++voxel) visit(voxel);
  }
}

std::size_t VoxelMap::drop_beyond(const Eigen::Vector3d& center, double distance_m) {
  const Eigen::Vector3f single = center.cast<float>();
  const auto limit = static_cast<float>(distance_m * distance_m);
  const std::size_t size_before = size_;
  std::vector<VoxelCoordinates> emptied;
  bounds_.setEmpty();
  brick_index_.for_each([&](KeyIndex::Key key, Index brick) {
    for (Index place = 0; place < kPlaces; ++place) {
      Cell& block = cells_[kPlaces * brick + place];
      std::uint64_t& mask = block.mask;
      if (mask == 0) continue;
      Index kept = block.begin;
      Index voxel = block.begin;
      for (std::uint64_t rest = mask; rest != 0; rest &= rest - 1, ++voxel) {
        if ((surface_[voxel].mean - single).squaredNorm() > limit) {
          mask &= ~(rest & (~rest + 1));  // the lowest bit of what remains
          continue;
        }
        bounds_.extend(surface_[voxel].mean.cast<double>());
        copy_voxel(voxel, kept++);
      }
      size_ -= voxel - kept;
      block.count = static_cast<std::uint8_t>(kept - block.begin);
      if (block.count > 0) continue;
      unused_blocks_[block.size_class].push_back(block.begin);
      emptied.push_back(kBrickCells * voxel_of_key(key) + cell_bits::at_place(place));
    }
  });
  for (const VoxelCoordinates& cell : emptied) release(cell);
  return size_before - size_;
}

std::size_t VoxelMap::limit_size(const Eigen::Vector3d& center) {
  const auto allowed = static_cast<std::size_t>(parameters_.max_voxels);
  if (size() <= allowed) return 0;
  const auto kept = static_cast<std::size_t>((1.0 - kLimitReserve) * static_cast<double>(allowed));
  const Eigen::Vector3f single = center.cast<float>();
  std::vector<float> distances;
  distances.reserve(size());
  for_each_voxel([&](Index voxel) { distances.push_back((surface_[voxel].mean - single).norm()); });
  const auto border = distances.begin() + static_cast<std::ptrdiff_t>(kept);
  std::nth_element(distances.begin(), border, distances.end());
  // A little nearer than the first that has to go: it goes with all that are as far.
  return drop_beyond(center, *border * (1.0 - 1e-6));
}

VoxelMap::Index VoxelMap::find(const Eigen::Vector3d& point) const {
  if (!point.allFinite() || point.cwiseAbs().maxCoeff() > farthest_m_) return kNone;
  return find_voxel(voxel_of(point, inverse_voxel_));
}

std::size_t VoxelMap::find_nearby(Index index, const VoxelCoordinates& cell, const VoxelCoordinates& low,
                                  const VoxelCoordinates& high, NearbyVoxels& found) const {
  // For each axis: which coordinates are in the box.
  const std::uint32_t ranges[3] = {cell_bits::nearby_range(cell.x(), low.x(), high.x()),
                                   cell_bits::nearby_range(cell.y(), low.y(), high.y()),
                                   cell_bits::nearby_range(cell.z(), low.z(), high.z())};
  std::uint32_t wanted_cells = nearby_[index];
  for (std::size_t axis = 0; axis < 3; ++axis) wanted_cells &= cell_bits::nearby_of_range(axis, ranges[axis]);
  if (wanted_cells == 0) return 0;
  // For each axis and each of the three cells along it: the voxels in the box.
  std::uint64_t slabs[3][3];
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (std::uint32_t side = 0; side < 3; ++side) {
      slabs[axis][side] = cell_bits::kSlabOf[axis][ranges[axis] >> 4 * side & 15U];
    }
  }
  // The bricks that the cell's neighbours are in: beyond it along none, one, two or all axes.
  std::array<Index, 8> bricks;
  bricks.fill(kNone);
  bricks[0] = index / kPlaces;
  const auto& neighbours = cell_bits::kNeighbours[index % kPlaces];
  std::size_t count = 0;
  for (; wanted_cells != 0; wanted_cells &= wanted_cells - 1) {
    const auto neighbour = static_cast<std::size_t>(__builtin_ctz(wanted_cells));
    const auto& [x, y, z] = cell_bits::kNearbySides[neighbour];
    const Index place = neighbours[neighbour];
    Index& brick = bricks[place / kPlaces];
    if (brick == kNone) brick = find_brick(brick_of({cell.x() + x - 1, cell.y() + y - 1, cell.z() + z - 1}));
    const Index other = kPlaces * brick + place % kPlaces;
    const std::uint64_t mask = cells_[other].mask;
    const std::uint64_t wanted = mask & slabs[0][x] & slabs[1][y] & slabs[2][z];
    const Index begin = cells_[other].begin;
    __builtin_prefetch(&surface_[begin]);
    // Written down in any case, and the next one over it where nothing is wanted: that is quicker than to jump.
    found[count] = {begin, mask, wanted};
    count += static_cast<std::size_t>(wanted != 0);
  }
  return count;
}

VoxelMap::Index VoxelMap::find_voxel(const VoxelCoordinates& voxel) const {
  const Index cell = find_cell(cell_of(voxel));
  return cell == kNone ? kNone : find_voxel(cell, cell_bits::bit_of(voxel));
}

PointCloud VoxelMap::points_within(const Eigen::Vector3d& center, double radius_m) const {
  const Eigen::Vector3f single = center.cast<float>();
  const auto limit = static_cast<float>(radius_m * radius_m);
  PointCloud found;
  for_each_voxel([&](Index voxel) {
    if ((surface_[voxel].mean - single).squaredNorm() <= limit) found.push_back(surface_[voxel].mean);
  });
  return found;
}

PointCloud VoxelMap::points() const {
  PointCloud all;
  all.reserve(size());
  for_each_voxel([&](Index voxel) { all.push_back(surface_[voxel].mean); });
  return all;
}

std::size_t VoxelMap::memory_bytes() const {
  std::size_t indices = unused_bricks_.capacity();
  for (const auto& unused : unused_blocks_) indices += unused.capacity();
  return brick_index_.memory_bytes() + observed_.memory_bytes() + near_.capacity() * sizeof(std::uint64_t) +
         nearby_.capacity() * sizeof(std::uint32_t) + cells_.capacity() * sizeof(Cell) +
         surface_.capacity() * (sizeof(Surface) + sizeof(Counts)) + indices * sizeof(Index);
}

}  // namespace urban_gnss
