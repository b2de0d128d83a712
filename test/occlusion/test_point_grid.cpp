#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "urban_gnss_localization/common/random.hpp"
#include "urban_gnss_localization/occlusion/point_grid.hpp"

namespace urban_gnss {
namespace {

Eigen::Vector3f draw_place(RandomEngine& engine, double spread_m) {
  return (spread_m * Eigen::Vector3d(draw_normal(engine), draw_normal(engine), draw_normal(engine))).cast<float>();
}

/// Indices of the points, nearest first.
std::vector<PointGrid::Neighbour> by_distance(const PointCloud& cloud, const Eigen::Vector3f& place) {
  std::vector<PointGrid::Neighbour> all;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const Eigen::Vector3f offset = cloud[i] - place;
    all.push_back({offset.x() * offset.x() + offset.y() * offset.y() + offset.z() * offset.z(),
                   static_cast<PointGrid::Index>(i)});
  }
  std::sort(all.begin(), all.end(), [](const auto& a, const auto& b) { return a.squared_m2 < b.squared_m2; });
  return all;
}

TEST(PointGrid, EqualsTryingAllPoints) {
  RandomEngine engine = make_engine(1);
  for (const double edge_m : {0.05, 0.8, 30.0}) {
    PointCloud cloud;
    for (int i = 0; i < 1500; ++i) cloud.push_back(draw_place(engine, i % 50 == 0 ? 60.0 : 4.0));
    const PointGrid grid(cloud, edge_m);
    std::vector<PointGrid::Neighbour> found;
    int none = 0;
    for (int i = 0; i < 300; ++i) {
      const Eigen::Vector3f place = i % 3 == 0 ? cloud[static_cast<std::size_t>(i)] : draw_place(engine, 8.0);
      const auto expected = by_distance(cloud, place);
      const double reach_m = 3.0 * draw_uniform(engine);
      PointGrid::Neighbour nearest{};
      const bool is_near = grid.nearest(place, reach_m, nearest);
      ASSERT_EQ(is_near, expected[0].squared_m2 <= reach_m * reach_m) << edge_m << ' ' << i;
      none += is_near ? 0 : 1;
      if (is_near) {
        ASSERT_EQ(nearest.point, expected[0].point) << edge_m << ' ' << i;
      }
      for (const std::size_t count : {1U, 10U, 2000U}) {
        grid.nearest(place, count, found);
        ASSERT_EQ(found.size(), std::min(count, cloud.size()));
        for (std::size_t k = 0; k < found.size(); ++k) ASSERT_EQ(found[k].squared_m2, expected[k].squared_m2) << k;
      }
    }
    EXPECT_GT(none, 50);
  }
}

TEST(PointGrid, TakesFewPointsCopiesAndFarOnes) {
  std::vector<PointGrid::Neighbour> found;
  PointGrid::Neighbour nearest{};
  const PointGrid empty({}, 1.0);
  EXPECT_FALSE(empty.nearest({0, 0, 0}, 1e9, nearest));
  empty.nearest({0, 0, 0}, 5, found);
  EXPECT_TRUE(found.empty());
  const PointGrid far({{1e30F, 0, 0}, {0, -1e30F, 0}, {7, 7, 7}, {7, 7, 7}}, 0.1);
  EXPECT_TRUE(far.nearest({7, 7, 7.5}, 1.0, nearest));
  EXPECT_EQ(nearest.squared_m2, 0.25F);
  EXPECT_FALSE(far.nearest({-2e30F, 7, 7}, 1.0, nearest));
  far.nearest({7, 7, 7}, 10, found);
  ASSERT_EQ(found.size(), 4u);
  EXPECT_EQ(found[1].squared_m2, 0.0F);
}

}  // namespace
}  // namespace urban_gnss
