// An encoder that says 0 while the robot drives is no standstill. The default localizer with its default parameters.

#include "pipeline_rig.hpp"
#include "urban_gnss_localization/localizers/switching/imm_ekf.hpp"

namespace urban_gnss {
namespace {

constexpr double kDies_s = 60.0;
constexpr double kEnd_s = 120.0;

struct Drive {
  Rig rig{with(LocalizationParameters{}, kGiven), std::make_unique<ImmEkf>(ImmEkfParameters{}, MotionParameters{})};

  explicit Drive(bool with_velocities) {
    const Pose2 last = Rig::odometry(kDies_s).pose;
    for (int k = 0; k <= std::lround(10.0 * kEnd_s); ++k) {
      const double time = 0.1 * k;
      if (k % 10 == 0) rig.fix(time);
      if (with_velocities && k % 10 == 0) rig.pipeline.add_velocity(Rig::velocity(time));
      OdometrySample sample = Rig::odometry(time);
      if (time > kDies_s) {
        sample.pose = last;
        sample.twist = {0.0, 0.0};
      }
      rig.pipeline.add_odometry(sample);
    }
  }
  double error_m() const { return (rig.pipeline.estimate().pose.position() - Rig::truth(kEnd_s).position()).norm(); }
};

TEST(DeadEncoder, TheReceiversVelocityTakesItsPlace) {
  const Drive drive(true);
  EXPECT_LT(drive.error_m(), 5.0);
}

TEST(DeadEncoder, WithoutAVelocityTheEstimateIsNotTrusted) {
  const Drive drive(false);
  const LocalizationReport report = drive.rig.pipeline.report();
  EXPECT_TRUE(!report.healthy || drive.error_m() < 3.0 * report.position_sigma_m) << report.reason;
  EXPECT_LT(drive.error_m(), 3.0 * report.position_sigma_m) << report.reason;
}

}  // namespace
}  // namespace urban_gnss
