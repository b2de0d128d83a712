#pragma once

#include <gtest/gtest.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "urban_gnss_localization/common/parameters.hpp"
#include "urban_gnss_localization/common/random.hpp"
#include "urban_gnss_localization/geometry/pose2.hpp"
#include "urban_gnss_localization/localizers/particle_set.hpp"
#include "urban_gnss_localization/parameters/parameter_list.hpp"
#include "urban_gnss_localization/parameters/parameter_reader.hpp"

namespace urban_gnss {

/// Both coordinates and the angle (on the circle) within `tolerance`.
inline ::testing::AssertionResult near(const Pose2& actual, const Pose2& expected, double tolerance) {
  const double distance = std::max({std::abs(actual.x - expected.x), std::abs(actual.y - expected.y),
                                    std::abs(angle_difference(actual.yaw, expected.yaw))});
  if (distance <= tolerance) return ::testing::AssertionSuccess();
  return ::testing::AssertionFailure() << "(" << actual.x << ", " << actual.y << ", " << actual.yaw << ") is "
                                       << distance << " from (" << expected.x << ", " << expected.y << ", "
                                       << expected.yaw << "), tolerance " << tolerance;
}

inline bool operator==(const Pose2& a, const Pose2& b) { return a.x == b.x && a.y == b.y && a.yaw == b.yaw; }

/// Mean and variance of independent Gaussian values within 4.5 standard deviations of these estimators: a right
/// program fails for one seed of 70 000.
inline ::testing::AssertionResult has_moments(const std::vector<double>& values, double mean, double variance) {
  const auto n = static_cast<double>(values.size());
  double sum = 0.0;
  double squares = 0.0;
  for (const double v : values) {
    sum += v - mean;
    squares += (v - mean) * (v - mean);
  }
  const double mean_sigmas = sum / n / std::sqrt(variance / n);
  const double variance_sigmas = (squares / n - variance) / (variance * std::sqrt(2.0 / n));
  if (std::abs(mean_sigmas) < 4.5 && std::abs(variance_sigmas) < 4.5) return ::testing::AssertionSuccess();
  return ::testing::AssertionFailure() << "mean " << mean + sum / n << " (expected " << mean << ", " << mean_sigmas
                                       << " sigma off), variance " << squares / n << " (expected " << variance << ", "
                                       << variance_sigmas << " sigma off)";
}

inline double uniform_between(double low, double high, RandomEngine& engine) {
  return low + (high - low) * draw_uniform(engine);
}

inline Pose2 random_pose(RandomEngine& engine, double extent_m = 50.0) {
  const double x = uniform_between(-extent_m, extent_m, engine);
  const double y = uniform_between(-extent_m, extent_m, engine);
  return {x, y, uniform_between(-kPi, kPi, engine)};
}

/// A pose with independent errors.
inline PoseEstimate pose_with_sigma(const Pose2& pose, double position_sigma, double heading_sigma) {
  PoseEstimate estimate;
  estimate.pose = pose;
  const double p2 = position_sigma * position_sigma;
  estimate.covariance = Eigen::Vector3d(p2, p2, heading_sigma * heading_sigma).asDiagonal();
  return estimate;
}

inline Eigen::Matrix2d isotropic(double sigma) { return sigma * sigma * Eigen::Matrix2d::Identity(); }

/// Gives particles their weights, which need not be normalised.
inline void set_weights(ParticleSet& particles, const std::vector<double>& weights) {
  for (std::size_t i = 0; i < weights.size(); ++i) particles.log_weight[i] = static_cast<float>(std::log(weights[i]));
  particles.normalise();
}

/// Poses all over a square, with unequal weights.
inline ParticleSet random_particles(std::size_t count, RandomEngine& engine, double extent_m = 5.0) {
  ParticleSet particles(count);
  std::vector<double> weights;
  for (std::size_t i = 0; i < count; ++i) {
    particles.set_pose(i, random_pose(engine, extent_m));
    weights.push_back(0.01 + draw_uniform(engine));
  }
  set_weights(particles, weights);
  return particles;
}

/// `parameters` with what a YAML text says otherwise, by the names that users write.
template <class P>
P with(P parameters, const std::string& yaml) {
  const YAML::Node map = YAML::Load(yaml);
  ParameterReader reader(map);
  reader.read(parameters);
  for (const std::string& fault : reader.finish()) ADD_FAILURE() << fault;
  return parameters;
}

/// The names of all parameters of a struct.
template <class P>
std::vector<std::string> parameter_names(const P& parameters) {
  std::vector<std::string> names;
  ParameterList list;
  list.add(parameters);
  for (const ListedParameter& listed : list.parameters()) names.push_back(listed.name);
  return names;
}

}  // namespace urban_gnss
