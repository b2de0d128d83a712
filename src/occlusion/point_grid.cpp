#include "urban_gnss_localization/occlusion/point_grid.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "urban_gnss_localization/occlusion/cell_bits.hpp"

namespace urban_gnss {
namespace {

/// Summed in this order, as FLANN does it: equally near is the same to both.
float squared_distance(const Eigen::Vector3f& a, const Eigen::Vector3f& b) {
  const Eigen::Vector3f offset = a - b;
  return offset.x() * offset.x() + offset.y() * offset.y() + offset.z() * offset.z();
}

/// A reach that holds what is at this distance in spite of rounding.
double reach_to(float squared_m2) { return (1.0 + 1e-6) * std::sqrt(static_cast<double>(squared_m2)); }

}  // namespace

PointGrid::PointGrid(const PointCloud& points, double edge_m)
    : low_(Eigen::Array3f::Constant(std::numeric_limits<float>::infinity())), high_(-low_) {
  for (const Eigen::Vector3f& point : points) {
    low_ = low_.min(point.array());
    high_ = high_.max(point.array());
  }
  if (points.empty()) return;
  const double farthest_m = low_.abs().max(high_.abs()).maxCoeff();
  edge_m_ = std::max(edge_m, farthest_m / (kMaxVoxelCoordinate - 2));
  inverse_edge_ = 1.0 / edge_m_;
  struct Home {
    Index brick;
    Index place;
  };
  std::vector<Home> homes;
  homes.reserve(points.size());
  VoxelCoordinates last = VoxelCoordinates::Constant(std::numeric_limits<int>::max());
  Index brick = 0;
  for (const Eigen::Vector3f& point : points) {
    const VoxelCoordinates cube = voxel_of(point.cast<double>(), inverse_edge_);
    const VoxelCoordinates at = cell_bits::parent_of(cube);
    if (at != last) {
      brick = brick_index_.find_or_insert(voxel_key(at), static_cast<Index>(bricks_.size()));
      if (brick == bricks_.size()) bricks_.push_back({0, 0});
      last = at;
    }
    homes.push_back({brick, cell_bits::place_of(cube)});
    bricks_[brick].mask |= cell_bits::bit_of(cube);
  }
  Index cubes = 0;
  for (Brick& each : bricks_) {
    each.first_cube = cubes;
    cubes += static_cast<Index>(__builtin_popcountll(each.mask));
  }
  const auto cube_of = [&](const Home& home) {
    const Brick& each = bricks_[home.brick];
    return each.first_cube + cell_bits::rank(each.mask, std::uint64_t{1} << home.place);
  };
  begin_.assign(cubes + 1, 0);
  for (const Home& home : homes) ++begin_[cube_of(home) + 1];
  for (std::size_t i = 1; i < begin_.size(); ++i) begin_[i] += begin_[i - 1];
  std::vector<Index> next(begin_.begin(), begin_.end());
  points_.resize(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    points_[next[cube_of(homes[i])]++] = {points[i], static_cast<Index>(i)};
  }
}

template <class Visit>
void PointGrid::for_each_in(const Brick& brick, std::uint64_t wanted, Visit&& visit) const {
  for (std::uint64_t rest = wanted; rest != 0; rest &= rest - 1) {
    const Index cube = brick.first_cube + cell_bits::rank(brick.mask, rest & (~rest + 1));
    for (Index i = begin_[cube]; i < begin_[cube + 1]; ++i) visit(points_[i]);
  }
}

/// Calls visit(point) for all points in the cubes that the box about the place touches.
template <class Visit>
void PointGrid::for_each_near(const Eigen::Vector3f& place, double reach_m, Visit&& visit) const {
  // Not beyond the points, so that the box has few bricks and coordinates are no greater than theirs.
  const Eigen::Array3d center = place.cast<double>();
  const Eigen::Vector3d first = (center - reach_m).max(low_.cast<double>());
  const Eigen::Vector3d end = (center + reach_m).min(high_.cast<double>());
  if ((first.array() > end.array()).any()) return;
  const VoxelCoordinates low = voxel_of(first, inverse_edge_);
  const VoxelCoordinates high = voxel_of(end, inverse_edge_);
  const VoxelCoordinates low_brick = cell_bits::parent_of(low);
  const VoxelCoordinates high_brick = cell_bits::parent_of(high);
  const auto wanted_of = [&](const VoxelCoordinates& at) {
    return cell_bits::slab(0, at.x(), low.x(), high.x()) & cell_bits::slab(1, at.y(), low.y(), high.y()) &
           cell_bits::slab(2, at.z(), low.z(), high.z());
  };
  const Eigen::Vector3d sides = (high_brick - low_brick).cast<double>().array() + 1.0;
  if (sides.prod() > static_cast<double>(bricks_.size())) {
    brick_index_.for_each([&](KeyIndex::Key key, KeyIndex::Index found) {
      const VoxelCoordinates at = voxel_of_key(key);
      if ((at.array() < low_brick.array()).any() || (at.array() > high_brick.array()).any()) return;
      for_each_in(bricks_[found], bricks_[found].mask & wanted_of(at), visit);
    });
    return;
  }
  VoxelCoordinates at;
  for (at.x() = low_brick.x(); at.x() <= high_brick.x(); ++at.x()) {
    for (at.y() = low_brick.y(); at.y() <= high_brick.y(); ++at.y()) {
      for (at.z() = low_brick.z(); at.z() <= high_brick.z(); ++at.z()) {
        const KeyIndex::Index found = brick_index_.find(voxel_key(at));
        if (found != KeyIndex::kNone) for_each_in(bricks_[found], bricks_[found].mask & wanted_of(at), visit);
      }
    }
  }
}

/// The distance of the corner of the cloud's box that is farthest from the place.
double PointGrid::reach_of_all(const Eigen::Vector3f& place) const {
  const Eigen::Array3d center = place.cast<double>();
  return (center - low_.cast<double>()).abs().max((center - high_.cast<double>()).abs()).matrix().norm();
}

bool PointGrid::nearest(const Eigen::Vector3f& place, double reach_m, Neighbour& found) const {
  // At first no farther than to the next cubes; if nothing is as near, as far as what was found, or all the way.
  for (double reach = std::min(0.5 * edge_m_, reach_m);;) {
    found.squared_m2 = std::numeric_limits<float>::infinity();
    for_each_near(place, reach, [&](const Point& point) {
      const float squared_m2 = squared_distance(point.place, place);
      if (squared_m2 < found.squared_m2) found = {squared_m2, point.index};
    });
    if (found.squared_m2 <= reach * reach) return true;
    if (reach >= reach_m) return false;
    reach = std::min(reach_to(found.squared_m2), reach_m);
  }
}

void PointGrid::nearest(const Eigen::Vector3f& place, std::size_t count, std::vector<Neighbour>& found) const {
  const std::size_t wanted = std::min(count, points_.size());
  found.clear();
  if (wanted == 0) return;
  const double reach_of_all_m = reach_of_all(place) + edge_m_;
  for (double reach = edge_m_;;) {
    found.clear();
    for_each_near(place, reach, [&](const Point& point) {
      const float squared_m2 = squared_distance(point.place, place);
      if (found.size() == wanted) {
        if (squared_m2 >= found.back().squared_m2) return;
        found.pop_back();
      }
      const auto behind = [](float squared, const Neighbour& other) { return squared < other.squared_m2; };
      found.insert(std::upper_bound(found.begin(), found.end(), squared_m2, behind), {squared_m2, point.index});
    });
    const bool is_full = found.size() == wanted;
    if (is_full && (found.back().squared_m2 <= reach * reach || reach >= reach_of_all_m)) return;
    reach = is_full ? reach_to(found.back().squared_m2) : std::min(2.0 * reach, 2.0 * reach_of_all_m);
  }
}

}  // namespace urban_gnss
