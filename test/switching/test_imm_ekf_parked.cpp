// The default localizer, with its default parameters, on a robot that stands.

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "matchers.hpp"
#include "urban_gnss_localization/localizers/switching/imm_ekf.hpp"

namespace urban_gnss {
namespace {

constexpr double kDeclared_m = 3.0;

/// Fixes with an error of 2.5 m that lasts for half a minute, as receivers have it.
class Receiver {
 public:
  explicit Receiver(std::uint64_t seed) : engine_(make_engine(seed)), error_(draw()) {}

  FixMeasurement fix(const Eigen::Vector2d& truth, double time_s) {
    const double rho = std::exp(-1.0 / 30.0);
    error_ = rho * error_ + std::sqrt(1.0 - rho * rho) * draw();
    FixMeasurement fix;
    fix.position = truth + error_;
    fix.covariance = isotropic(kDeclared_m);
    fix.time_s = time_s;
    return fix;
  }

 private:
  Eigen::Vector2d draw() {
    const double x = draw_normal(engine_);
    return 2.5 * Eigen::Vector2d(x, draw_normal(engine_));
  }

  RandomEngine engine_;
  Eigen::Vector2d error_;
};

double position_sigma_m(const ImmEkf& filter) {
  return std::sqrt(0.5 * filter.estimate().covariance.topLeftCorner<2, 2>().trace());
}

TEST(ImmEkfParked, PoseDoesNotCreepAndSigmaStaysHonest) {
  constexpr int kSeeds = 30;
  double nees = 0.0;
  double creep_m = 0.0;
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    Receiver receiver(seed);
    ImmEkf filter({}, {});
    filter.initialize(pose_with_sigma({0.0, 0.0, 0.0}, 3.0, 0.1));
    double time_s = 0.0;
    const auto park = [&](int seconds) {
      const Eigen::Vector2d start = filter.pose().position();
      double farthest_m = 0.0;
      for (int k = 0; k < seconds; ++k) {
        for (int step = 0; step < 10; ++step) filter.move({0.0, 0.0}, 0.1);
        time_s += 1.0;
        filter.correct(receiver.fix({0.0, 0.0}, time_s));
        farthest_m = std::max(farthest_m, (filter.pose().position() - start).norm());
      }
      return farthest_m;
    };
    park(1200);
    creep_m += park(120) / kSeeds;
    EXPECT_GT(position_sigma_m(filter), 0.3) << "seed " << seed << ": the error of 2.5 m does not average out";
    const Eigen::Vector2d error = filter.pose().position();
    const Eigen::Matrix2d covariance = filter.estimate().covariance.topLeftCorner<2, 2>();
    nees += error.dot(covariance.ldlt().solve(error)) / kSeeds;
  }
  RecordProperty("nees", std::to_string(nees));
  RecordProperty("creep_m", std::to_string(creep_m));
  EXPECT_LT(creep_m, 0.5) << "m in two minutes, where the fixes wander by some metres";
  EXPECT_LT(nees, 6.0) << "sigma is at most 1.7 times too small";
}

}  // namespace
}  // namespace urban_gnss
