#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cmath>

#include "urban_gnss_localization/common/random.hpp"
#include "urban_gnss_localization/geometry/angles.hpp"
#include "urban_gnss_localization/simulation/knife_edge.hpp"

namespace urban_gnss {
namespace {

double uniform(RandomEngine& engine, double low, double high) { return low + (high - low) * draw_uniform(engine); }

TEST(KnifeEdge, LossFollowsTheFresnelIntegral) {
  // ITU-R P.526 eq. (30), the field behind an edge by the Fresnel integrals C and S (summed here); (31) approximates
  // it.
  double c = 0.0;
  double s = 0.0;
  const double step = 1e-5;
  for (double v = 0.0; v < 8.0; v += step) {
    c += std::cos(0.5 * kPi * (v + 0.5 * step) * (v + 0.5 * step)) * step;
    s += std::sin(0.5 * kPi * (v + 0.5 * step) * (v + 0.5 * step)) * step;
    const double field = 0.5 * std::hypot(1.0 - c - s, c - s);
    ASSERT_NEAR(knife_edge_loss_db(v + step), -20.0 * std::log10(field), 0.3) << v;
  }
  EXPECT_NEAR(knife_edge_loss_db(0.0), 6.02, 0.05);
  EXPECT_NEAR(knife_edge_loss_db(kClearOfEdge + 1e-9), 0.0, 0.02);
  EXPECT_EQ(knife_edge_loss_db(-5.0), 0.0);
}

TEST(KnifeEdge, GeometryIsThatOfAPlaneWave) {
  RandomEngine engine = make_engine(11);
  for (int trial = 0; trial < 1000; ++trial) {
    const double distance = uniform(engine, 0.1, 200.0);
    const double height = uniform(engine, -10.0, 80.0);
    const double elevation = uniform(engine, 0.05, 1.5);
    const Eigen::Vector2d edge(distance, height);
    const Eigen::Vector2d ray(std::cos(elevation), std::sin(elevation));
    const double foot = edge.dot(ray);
    const KnifeEdge result = knife_edge(distance, height, elevation);
    if (foot <= 0.0) {
      EXPECT_EQ(knife_edge_loss_db(result.parameter), 0.0);
      continue;
    }
    const double above = ray.x() * edge.y() - ray.y() * edge.x();
    EXPECT_NEAR(result.parameter, above * std::sqrt(2.0 / (0.1902937 * foot)), 1e-5 * std::abs(result.parameter));
    EXPECT_NEAR(result.excess_m, edge.norm() - foot, 1e-9);
  }
}

}  // namespace
}  // namespace urban_gnss
