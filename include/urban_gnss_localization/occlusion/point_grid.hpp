#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "urban_gnss_localization/occlusion/key_index.hpp"
#include "urban_gnss_localization/occlusion/point_cloud.hpp"
#include "urban_gnss_localization/occlusion/voxel_walk.hpp"

namespace urban_gnss {

/// The nearest of a cloud's points to a place, exactly: the points sorted into cubes, four of a side to a brick that a
/// hash table finds. Made in a tenth of a kd-tree's time, and asked in less of it where the edge is about the distance
/// of the points from each other and from the places.
class PointGrid {
 public:
  using Index = std::uint32_t;  ///< into the cloud

  struct Neighbour {
    float squared_m2;
    Index point;
  };

  PointGrid() = default;
  /// Of finite points; `edge_m` > 0 is that of a cube, if it is not too small to number the cubes.
  PointGrid(const PointCloud& points, double edge_m);

  std::size_t size() const { return points_.size(); }

  /// The nearest point within `reach_m` of a finite `place`; false where there is none.
  bool nearest(const Eigen::Vector3f& place, double reach_m, Neighbour& found) const;

  /// The `count` nearest points, all if there are less, nearest first. `found` is written anew.
  void nearest(const Eigen::Vector3f& place, std::size_t count, std::vector<Neighbour>& found) const;

 private:
  struct Brick {
    std::uint64_t mask;  ///< of its cubes that hold points
    Index first_cube;    ///< of these, in begin_
  };
  struct Point {
    Eigen::Vector3f place;
    Index index;
  };

  template <class Visit>
  void for_each_near(const Eigen::Vector3f& place, double reach_m, Visit&& visit) const;
  template <class Visit>
  void for_each_in(const Brick& brick, std::uint64_t wanted, Visit&& visit) const;
  double reach_of_all(const Eigen::Vector3f& place) const;

  double inverse_edge_{1.0};
  double edge_m_{1.0};
  KeyIndex brick_index_;
  std::vector<Brick> bricks_;
  std::vector<Index> begin_;   ///< of each cube's points, and the end of the last
  std::vector<Point> points_;  ///< cube by cube
  Eigen::Array3f low_;         ///< of all points
  Eigen::Array3f high_;
};

}  // namespace urban_gnss
