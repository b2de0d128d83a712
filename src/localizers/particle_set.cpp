#include "urban_gnss_localization/localizers/particle_set.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

#include "urban_gnss_localization/common/vector_math.hpp"

namespace urban_gnss {
namespace {

URBAN_GNSS_VECTORISED float largest_of(const std::vector<float>& values) {
  constexpr std::size_t kLanes = 16;
  float lanes[kLanes];
  std::fill(lanes, lanes + kLanes, -std::numeric_limits<float>::infinity());
  const std::size_t whole = values.size() - values.size() % kLanes;
  for (std::size_t first = 0; first < whole; first += kLanes) {
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      const float value = values[first + lane];
      lanes[lane] = value > lanes[lane] ? value : lanes[lane];  // not one that is NaN
    }
  }
  for (std::size_t i = whole; i < values.size(); ++i) {
    if (values[i] > lanes[0]) lanes[0] = values[i];
  }
  return *std::max_element(lanes, lanes + kLanes);
}

/// Puts the exponentials of the logarithms, less `largest`, into `values`, and returns their sum. That of NaN is 0.
URBAN_GNSS_VECTORISED double exponentiate(const std::vector<float>& logarithms, float largest,
                                          std::vector<float>& values) {
  const float* __restrict const from = logarithms.data();
  float* __restrict const to = values.data();
  for (std::size_t i = 0; i < values.size(); ++i) {
    const float value = vector_exp(from[i] - largest);
    to[i] = value > 0.0F ? value : 0.0F;
  }
  return vector_sums<1>(values.size(),
                        [&](std::size_t i) URBAN_GNSS_INLINE_LAMBDA { return std::array<double, 1>{to[i]}; })[0];
}

URBAN_GNSS_VECTORISED void scale(ParticleSet& particles, float factor, float log_factor) {
  float* __restrict const weight = particles.weight.data();
  float* __restrict const log_weight = particles.log_weight.data();
  for (std::size_t i = 0; i < particles.size(); ++i) {
    weight[i] *= factor;
    log_weight[i] = std::isnan(log_weight[i]) ? -std::numeric_limits<float>::infinity() : log_weight[i] + log_factor;
  }
}

}  // namespace

ParticleSet::ParticleSet(std::size_t count) : x(count), y(count), yaw(count), log_weight(count), weight(count) {
  set_equal_weights();
}

void ParticleSet::resize(std::size_t count) {
  for (std::vector<float>* values : {&x, &y, &yaw, &log_weight, &weight}) values->resize(count);
}

void ParticleSet::set_pose(std::size_t i, const Pose2& pose) {
  x[i] = static_cast<float>(pose.x - origin.x());
  y[i] = static_cast<float>(pose.y - origin.y());
  yaw[i] = static_cast<float>(pose.yaw);
}

void ParticleSet::recentre(const Eigen::Vector2d& place) {
  const Eigen::Vector2d way = place - origin;
  if (!(way.norm() > 16.0) || !way.allFinite()) return;
  origin = place;
  for (float& value : x) value = static_cast<float>(value - way.x());
  for (float& value : y) value = static_cast<float>(value - way.y());
}

void ParticleSet::draw_gaussian(const PoseEstimate& start, RandomEngine& engine) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> decomposition(start.covariance);
  const Eigen::Matrix3d root =
      decomposition.eigenvectors() * decomposition.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal();
  origin = start.pose.position();
  const bool heading_unknown = start.covariance(2, 2) >= kPi * kPi / 3.0;
  for (std::size_t i = 0; i < size(); ++i) {
    Eigen::Vector3d draw;
    for (int axis = 0; axis < 3; ++axis) draw(axis) = draw_normal(engine);
    const Eigen::Vector3d offset = root * draw;
    set_pose(i, {start.pose.x + offset.x(), start.pose.y + offset.y(),
                 heading_unknown ? kPi * (2.0 * draw_uniform(engine) - 1.0) : wrap_angle(start.pose.yaw + offset.z())});
  }
  set_equal_weights();
}

void ParticleSet::spread(double position_m2, double heading_rad2, RandomEngine& engine) {
  const double position_m = std::sqrt(position_m2);
  const double heading_rad = std::sqrt(heading_rad2);
  for (std::size_t i = 0; i < size(); ++i) {
    const double dx = position_m * draw_normal(engine);
    const double dy = position_m * draw_normal(engine);
    const Pose2 from = pose(i);
    set_pose(i, {from.x + dx, from.y + dy, wrap_angle(from.yaw + heading_rad * draw_normal(engine))});
  }
}

void ParticleSet::set_equal_weights() {
  if (size() == 0) return;
  const double share = 1.0 / static_cast<double>(size());
  std::fill(weight.begin(), weight.end(), static_cast<float>(share));
  std::fill(log_weight.begin(), log_weight.end(), static_cast<float>(std::log(share)));
}

bool ParticleSet::normalise() {
  // A particle whose weight is not a number carries no information: it gets none.
  const float largest = largest_of(log_weight);
  if (!std::isfinite(largest)) {
    set_equal_weights();
    return false;
  }
  const double sum = exponentiate(log_weight, largest, weight);
  scale(*this, static_cast<float>(1.0 / sum), static_cast<float>(-largest - std::log(sum)));
  return true;
}

}  // namespace urban_gnss
