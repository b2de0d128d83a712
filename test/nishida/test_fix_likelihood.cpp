#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

#include "matchers.hpp"
#include "urban_gnss_localization/localizers/nishida/fix_likelihood.hpp"

namespace urban_gnss {
namespace {

constexpr LikelihoodForm kForms[] = {LikelihoodForm::kPrinted, LikelihoodForm::kSum, LikelihoodForm::kProduct};

FixLikelihood example(LikelihoodForm form) {
  FixLikelihood fix;
  fix.form = form;
  fix.fix = {3.0, -2.0};
  fix.direct_covariance << 1.5, 0.6, 0.6, 0.9;
  fix.shadow_sigma = 1.2;
  fix.heading_sigma = 0.4;
  fix.radius = 3.5;
  fix.fix_heading = 3.0;
  return fix;
}

/// Eq. (27) to (33) without logarithms: the oracle of the form that the filter uses.
double plain_log_likelihood(const Pose2& pose, const FixLikelihood& fix) {
  const auto density = [](double deviation, double sigma) {
    return std::exp(-0.5 * deviation * deviation / (sigma * sigma)) / std::sqrt(2.0 * kPi * sigma * sigma);
  };
  const Eigen::Vector2d d = transform_point(pose, fix.antenna_in_body) - fix.fix;
  const double d_heading = angle_difference(pose.yaw, fix.fix_heading);
  const double d_ring = d.norm() - fix.radius;
  const double heading = density(d_heading, fix.heading_sigma);
  double direct = 0.0;
  double shadow = 0.0;
  if (fix.form == LikelihoodForm::kProduct) {
    direct = std::exp(-0.5 * d.dot(fix.direct_covariance.inverse() * d)) /
             (2.0 * kPi * std::sqrt(fix.direct_covariance.determinant()));
    shadow = density(d_ring, fix.shadow_sigma) / (2.0 * kPi * std::max(fix.radius, fix.shadow_sigma));
    if (fix.with_heading) {
      direct *= heading;
      shadow *= heading;
    }
  } else {
    // 1/(2 pi sigma^2) is the one-dimensional normaliser squared.
    const auto term = [&](double deviation, double sigma) {
      const double extra = fix.form == LikelihoodForm::kPrinted ? 1.0 / std::sqrt(2.0 * kPi * sigma * sigma) : 1.0;
      return density(deviation, sigma) * extra;
    };
    const double heading_term = fix.with_heading ? term(d_heading, fix.heading_sigma) / 3.0 : 0.0;
    direct = 2.0 / 3.0 *
                 (term(d.x(), std::sqrt(fix.direct_covariance(0, 0))) +
                  term(d.y(), std::sqrt(fix.direct_covariance(1, 1)))) +
             heading_term;
    shadow = 2.0 / 3.0 * term(d_ring, fix.shadow_sigma) + heading_term;
  }
  return std::log(fix.with_shadow ? 0.5 * direct + 0.5 * shadow : direct);
}

double weighed(const Pose2& pose, const FixLikelihood& fix) {
  ParticleSet particles(1);
  particles.set_pose(0, pose);
  particles.log_weight[0] = 0.0F;
  weigh(particles, fix);
  return particles.log_weight[0];
}

TEST(FixLikelihood, ArrayFormIsThePlainFormForAllForms) {
  RandomEngine engine = make_engine(1);
  for (const LikelihoodForm form : kForms) {
    for (int flags = 0; flags < 8; ++flags) {
      FixLikelihood fix = example(form);
      fix.with_shadow = (flags & 1) != 0;
      fix.with_heading = (flags & 2) != 0;
      if ((flags & 4) != 0) fix.antenna_in_body = {-1.3, 0.8};
      ParticleSet particles = random_particles(300, engine, 6.0);
      const ParticleSet before = particles;
      weigh(particles, fix);
      for (std::size_t i = 0; i < particles.size(); ++i) {
        // Logarithms of sums of exponentials of up to some hundreds: 1e-12 is a few roundings of those. Floats have a
        // dozen roundings of 6e-8 of the logarithm, of places (in sigmas) and of the weight before, which is -7.
        const double expected = plain_log_likelihood(before.pose(i), fix);
        const double floats = 1e-6 * (10.0 + std::abs(expected));
        ASSERT_NEAR(particles.log_weight[i] - before.log_weight[i], expected, floats)
            << enum_name(form) << ' ' << flags;
        ASSERT_NEAR(log_likelihood(before.pose(i), fix), expected, 1e-11) << enum_name(form) << ' ' << flags;
      }
    }
  }
}

// Eq. (27)-(33), typed out from the text.
TEST(FixLikelihood, PrintedFormIsThatOfThePaper) {
  RandomEngine engine = make_engine(2);
  const double sb2 = 0.49, ss2 = 1.44, sp2 = 0.16, r = 3.5;
  for (int trial = 0; trial < 300; ++trial) {
    const Pose2 p = random_pose(engine, 6.0);
    FixLikelihood fix = example(LikelihoodForm::kPrinted);
    fix.direct_covariance = sb2 * Eigen::Matrix2d::Identity();
    fix.with_heading = true;
    const double dx = p.x - 3.0;
    const double dy = p.y + 2.0;
    const double dt = std::remainder(p.yaw - 3.0, 2.0 * M_PI);
    const double dxy = std::sqrt(dx * dx + dy * dy) - r;
    const double p_direct =
        2.0 / 3.0 / (2.0 * M_PI * sb2) * (std::exp(-dx * dx / (2.0 * sb2)) + std::exp(-dy * dy / (2.0 * sb2))) +
        1.0 / 3.0 / (2.0 * M_PI * sp2) * std::exp(-dt * dt / (2.0 * sp2));
    const double p_shadow = 2.0 / 3.0 / (2.0 * M_PI * ss2) * std::exp(-dxy * dxy / (2.0 * ss2)) +
                            1.0 / 3.0 / (2.0 * M_PI * sp2) * std::exp(-dt * dt / (2.0 * sp2));
    EXPECT_NEAR(log_likelihood(p, fix), std::log(0.5 * p_direct + 0.5 * p_shadow), 1e-12);
    fix.with_shadow = false;  // (47)
    EXPECT_NEAR(log_likelihood(p, fix), std::log(p_direct), 1e-11);
  }
}

/// Integral over the plane on a grid about the fix. The functions are smooth on the scale of a step.
double integral(const FixLikelihood& fix, double half_width, double step) {
  double sum = 0.0;
  const int cells = static_cast<int>(half_width / step);
  for (int i = -cells; i <= cells; ++i) {
    for (int j = -cells; j <= cells; ++j) {
      sum += std::exp(log_likelihood({fix.fix.x() + (i + 0.5) * step, fix.fix.y() + (j + 0.5) * step, 0.0}, fix));
    }
  }
  return sum * step * step;
}

TEST(FixLikelihood, ProductIntegratesToOne) {
  FixLikelihood direct = example(LikelihoodForm::kProduct);
  direct.with_shadow = false;
  EXPECT_NEAR(integral(direct, 9.0, 0.25), 1.0, 1e-9);  // beyond 9 m, 7 sigma, there is nothing

  // The ring integrates to the mean of a Gaussian cut off at 0 over max(r, sigma): 1 from a radius of 5 sigma on, and
  // that of the formula below it (0.40 at radius 0, 1.08 at one sigma).
  for (const double sigmas : {0.0, 1.0, 5.0, 8.0}) {
    FixLikelihood both = example(LikelihoodForm::kProduct);
    both.radius = sigmas * both.shadow_sigma;
    const double gaussian = std::exp(-0.5 * sigmas * sigmas) / std::sqrt(2.0 * kPi);
    const double cut_off = gaussian + sigmas * 0.5 * std::erfc(-sigmas / std::sqrt(2.0));
    const double ring = 2.0 * integral(both, both.radius + 9.0, 0.1) - 1.0;
    EXPECT_NEAR(ring, cut_off / std::max(sigmas, 1.0), 1e-3) << sigmas;  // the profile's kink at the fix
    if (sigmas >= 5.0) {
      EXPECT_NEAR(ring, 1.0, 1e-6) << sigmas;
    }
  }
}

TEST(FixLikelihood, SumFormHasOneDimensionalNormalisers) {
  FixLikelihood sum = example(LikelihoodForm::kSum);
  FixLikelihood printed = example(LikelihoodForm::kPrinted);
  // On the ring and far from both axes only the ring's term is left.
  const Pose2 on_ring{3.0 + 3.5 * std::sqrt(0.5), -2.0 + 3.5 * std::sqrt(0.5), 0.0};
  for (FixLikelihood* fix : {&sum, &printed}) fix->direct_covariance = 0.01 * Eigen::Matrix2d::Identity();
  EXPECT_NEAR(log_likelihood(on_ring, sum), std::log(0.5 * 2.0 / 3.0 / std::sqrt(2.0 * kPi * 1.44)), 1e-12);
  EXPECT_NEAR(log_likelihood(on_ring, printed), std::log(0.5 * 2.0 / 3.0 / (2.0 * kPi * 1.44)), 1e-12);
}

TEST(FixLikelihood, ProductCommutesWithRotationAndTranslation) {
  RandomEngine engine = make_engine(3);
  for (int trial = 0; trial < 100; ++trial) {
    const Pose2 frame = random_pose(engine);
    const Pose2 pose = random_pose(engine, 6.0);
    FixLikelihood fix = example(LikelihoodForm::kProduct);
    fix.with_heading = true;
    fix.antenna_in_body = {0.5, -0.4};
    FixLikelihood moved = fix;
    moved.fix = transform_point(frame, fix.fix);
    const Eigen::Matrix2d rotation = Eigen::Rotation2Dd(frame.yaw).toRotationMatrix();
    moved.direct_covariance = rotation * fix.direct_covariance * rotation.transpose();
    moved.fix_heading = fix.fix_heading + frame.yaw;
    EXPECT_NEAR(log_likelihood(compose(frame, pose), moved), log_likelihood(pose, fix), 1e-10);
  }
}

TEST(FixLikelihood, AKilometreAwayIsUnlikelyButNotImpossible) {
  for (const LikelihoodForm form : kForms) {
    for (const bool with_shadow : {false, true}) {
      FixLikelihood fix = example(form);
      fix.with_shadow = with_shadow;
      const double far = weighed({800.0, 600.0, 0.0}, fix);
      const double farther = weighed({1600.0, 1200.0, 0.0}, fix);
      EXPECT_TRUE(std::isfinite(far)) << enum_name(form);
      EXPECT_LT(farther, far);
      EXPECT_LT(far, -1e4);
    }
  }
}

TEST(FixLikelihood, FarFromTheDatumItIsAsAtIt) {
  FixLikelihood fix = example(LikelihoodForm::kProduct);
  fix.antenna_in_body = {1.0, 0.5};
  RandomEngine engine = make_engine(4);
  ParticleSet here = random_particles(300, engine);
  ParticleSet there = here;
  there.origin = {10000.0, -20000.0};
  weigh(here, fix);
  fix.fix += there.origin;
  weigh(there, fix);
  EXPECT_EQ(there.log_weight, here.log_weight);  // 20 km and 5 m are whole numbers of 2e-12 m: the difference is exact
}

TEST(FixLikelihood, HeadingOfTheFixEq12) {
  EXPECT_NEAR(fix_heading({1.0, 3.0}, {1.0, 1.0}, 0.2), kPi / 2.0 + 0.2, 1e-15);
  EXPECT_NEAR(fix_heading({-1.0, -1e-9}, {1.0, 0.0}, -0.2), kPi - 0.2, 1e-8);  // wrapped
}

}  // namespace
}  // namespace urban_gnss
