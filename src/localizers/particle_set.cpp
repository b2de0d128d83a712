#include "urban_gnss_localization/localizers/particle_set.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

namespace urban_gnss {

ParticleSet::ParticleSet(std::size_t count) : x(count), y(count), yaw(count), log_weight(count), weight(count) {
  set_equal_weights();
}

void ParticleSet::resize(std::size_t count) {
  for (std::vector<double>* values : {&x, &y, &yaw, &log_weight, &weight}) values->resize(count);
}

void ParticleSet::draw_gaussian(const PoseEstimate& start, RandomEngine& engine) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> decomposition(start.covariance);
  const Eigen::Matrix3d root =
      decomposition.eigenvectors() * decomposition.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal();
  const bool heading_unknown = start.covariance(2, 2) >= kPi * kPi / 3.0;
  for (std::size_t i = 0; i < size(); ++i) {
    Eigen::Vector3d draw;
    for (int axis = 0; axis < 3; ++axis) draw(axis) = draw_normal(engine);
    const Eigen::Vector3d offset = root * draw;
    x[i] = start.pose.x + offset.x();
    y[i] = start.pose.y + offset.y();
    yaw[i] = heading_unknown ? kPi * (2.0 * draw_uniform(engine) - 1.0) : wrap_angle(start.pose.yaw + offset.z());
  }
  set_equal_weights();
}

void ParticleSet::spread(double position_m2, double heading_rad2, RandomEngine& engine) {
  const double position_m = std::sqrt(position_m2);
  const double heading_rad = std::sqrt(heading_rad2);
  for (std::size_t i = 0; i < size(); ++i) {
    x[i] += position_m * draw_normal(engine);
    y[i] += position_m * draw_normal(engine);
    yaw[i] = wrap_angle(yaw[i] + heading_rad * draw_normal(engine));
  }
}

void ParticleSet::set_equal_weights() {
  if (size() == 0) return;
  const double share = 1.0 / static_cast<double>(size());
  std::fill(weight.begin(), weight.end(), share);
  std::fill(log_weight.begin(), log_weight.end(), std::log(share));
}

bool ParticleSet::normalise() {
  // A particle whose weight is not a number carries no information: it gets none.
  double largest = -std::numeric_limits<double>::infinity();
  for (double& lw : log_weight) {
    if (std::isnan(lw)) lw = -std::numeric_limits<double>::infinity();
    largest = std::max(largest, lw);
  }
  if (!std::isfinite(largest)) {
    set_equal_weights();
    return false;
  }
  double sum = 0.0;
  for (std::size_t i = 0; i < size(); ++i) {
    weight[i] = std::exp(log_weight[i] - largest);
    sum += weight[i];
  }
  const double log_sum = largest + std::log(sum);
  for (std::size_t i = 0; i < size(); ++i) {
    weight[i] /= sum;
    log_weight[i] -= log_sum;
  }
  return true;
}

}  // namespace urban_gnss
