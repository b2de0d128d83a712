#include "urban_gnss_localization/localizers/nishida/estimation.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "urban_gnss_localization/common/vector_math.hpp"

namespace urban_gnss {
namespace {

/// Sums from which a weighted mean pose with its angle on the circle follows.
struct PoseSums {
  double weight, x, y, cosine, sine;

  Pose2 mean(const Eigen::Vector2d& origin) const {
    return {origin.x() + x / weight, origin.y() + y / weight, std::atan2(sine, cosine)};
  }
};

/// Of the particles that `is_in` names; what the others are does not matter.
template <class IsIn>
URBAN_GNSS_INLINE PoseSums sum_poses(const ParticleSet& particles, const IsIn& is_in) {
  const float* const weight = particles.weight.data();
  const float* const x = particles.x.data();
  const float* const y = particles.y.data();
  const float* const yaw = particles.yaw.data();
  const auto sums = vector_sums<5>(particles.size(), [&](std::size_t i) URBAN_GNSS_INLINE_LAMBDA {
    const bool in = is_in(i);
    const SineCosine heading = vector_sincos(in ? yaw[i] : 0.0F);
    const double w = in ? weight[i] : 0.0F;
    return std::array<double, 5>{w, w * (in ? x[i] : 0.0F), w * (in ? y[i] : 0.0F), w * heading.cosine,
                                 w * heading.sine};
  });
  return {sums[0], sums[1], sums[2], sums[3], sums[4]};
}

URBAN_GNSS_VECTORISED PoseSums sums_of(const ParticleSet& particles) {
  return sum_poses(particles, [](std::size_t) URBAN_GNSS_INLINE_LAMBDA { return true; });
}

URBAN_GNSS_VECTORISED PoseSums sums_of(const ParticleSet& particles, const std::vector<std::uint32_t>& groups,
                                       std::uint32_t one) {
  const std::uint32_t* const group = groups.data();
  return sum_poses(particles, [=](std::size_t i) URBAN_GNSS_INLINE_LAMBDA { return group[i] == one; });
}

}  // namespace

URBAN_GNSS_VECTORISED double effective_sample_size(const ParticleSet& particles) {
  const float* const weight = particles.weight.data();
  const auto squares = vector_sums<1>(particles.size(), [=](std::size_t i) URBAN_GNSS_INLINE_LAMBDA {
    const double w = weight[i];
    return std::array<double, 1>{w * w};
  });
  return 1.0 / squares[0];
}

Pose2 circular_mean(const ParticleSet& particles) { return sums_of(particles).mean(particles.origin); }

Pose2 arithmetic_mean(const ParticleSet& particles) {
  Pose2 mean;
  double total = 0.0;
  for (std::size_t i = 0; i < particles.size(); ++i) {
    const double w = particles.weight[i];
    const Pose2 pose = particles.pose(i);
    mean.x += w * particles.x[i];
    mean.y += w * particles.y[i];
    mean.yaw += w * pose.yaw;
    total += w;
  }
  return {particles.origin.x() + mean.x / total, particles.origin.y() + mean.y / total, mean.yaw / total};
}

URBAN_GNSS_VECTORISED Eigen::Matrix3d covariance_about(const ParticleSet& particles, const Pose2& mean) {
  const float* const weight = particles.weight.data();
  const float* const x = particles.x.data();
  const float* const y = particles.y.data();
  const float* const yaw = particles.yaw.data();
  const double mean_x = mean.x - particles.origin.x();
  const double mean_y = mean.y - particles.origin.y();
  const auto mean_yaw = static_cast<float>(mean.yaw);
  const auto sums = vector_sums<6>(particles.size(), [=](std::size_t i) URBAN_GNSS_INLINE_LAMBDA {
    const double w = weight[i];
    const double dx = x[i] - mean_x;
    const double dy = y[i] - mean_y;
    const double dt = vector_wrap(yaw[i] - mean_yaw);
    return std::array<double, 6>{w * dx * dx, w * dx * dy, w * dy * dy, w * dx * dt, w * dy * dt, w * dt * dt};
  });
  Eigen::Matrix3d covariance;
  covariance << sums[0], sums[1], sums[3], sums[1], sums[2], sums[4], sums[3], sums[4], sums[5];
  return covariance;
}

double circular_sigma(const ParticleSet& particles) {
  const PoseSums sums = sums_of(particles);
  const double resultant = std::min(1.0, std::hypot(sums.cosine, sums.sine) / sums.weight);
  return resultant > 0.0 ? std::sqrt(-2.0 * std::log(resultant)) : std::numeric_limits<double>::infinity();
}

ParticleClusters::ParticleClusters(std::size_t particle_count, double cell_m)
    : cell_m_(cell_m), cell_of_particle_(particle_count, kNone) {
  std::size_t slots = 16;
  while (slots < 2 * particle_count) slots *= 2;
  table_.assign(slots, kNone);
  cells_.reserve(particle_count);
}

std::size_t ParticleClusters::slot_of(std::int64_t column, std::int64_t row) const {
  const std::size_t mask = table_.size() - 1;
  std::uint64_t hash = static_cast<std::uint64_t>(column) * 0x9E3779B97F4A7C15ULL;
  hash = (hash ^ (hash >> 29U)) + static_cast<std::uint64_t>(row) * 0xBF58476D1CE4E5B9ULL;
  std::size_t slot = static_cast<std::size_t>(hash ^ (hash >> 32U)) & mask;
  while (table_[slot] != kNone && (cells_[table_[slot]].column != column || cells_[table_[slot]].row != row)) {
    slot = (slot + 1) & mask;
  }
  return slot;
}

std::uint32_t ParticleClusters::root(std::uint32_t cell) {
  while (cells_[cell].parent != cell) {
    cells_[cell].parent = cells_[cells_[cell].parent].parent;
    cell = cells_[cell].parent;
  }
  return cell;
}

void ParticleClusters::find(const ParticleSet& particles) {
  std::fill(table_.begin(), table_.end(), kNone);
  cells_.clear();
  const double least_weight = 1e-3 / static_cast<double>(particles.size());
  for (std::size_t i = 0; i < particles.size(); ++i) {
    cell_of_particle_[i] = kNone;
    const double column = std::floor(particles.x[i] / cell_m_);
    const double row = std::floor(particles.y[i] / cell_m_);
    if (particles.weight[i] < least_weight || !(std::abs(column) < 1e15) || !(std::abs(row) < 1e15)) continue;
    const std::size_t slot = slot_of(static_cast<std::int64_t>(column), static_cast<std::int64_t>(row));
    if (table_[slot] == kNone) {
      table_[slot] = static_cast<std::uint32_t>(cells_.size());
      cells_.push_back({static_cast<std::int64_t>(column), static_cast<std::int64_t>(row), table_[slot], 0.0});
    }
    cell_of_particle_[i] = table_[slot];
    cells_[table_[slot]].mass += particles.weight[i];
  }
  constexpr std::int64_t kForward[4][2] = {{1, 0}, {-1, 1}, {0, 1}, {1, 1}};
  for (std::uint32_t c = 0; c < cells_.size(); ++c) {
    for (const auto& step : kForward) {
      const std::uint32_t neighbour = table_[slot_of(cells_[c].column + step[0], cells_[c].row + step[1])];
      if (neighbour != kNone) cells_[root(neighbour)].parent = root(c);
    }
  }
  count_ = 0;
  heaviest_ = kNone;
  heaviest_mass_ = 0.0;
  for (std::uint32_t c = 0; c < cells_.size(); ++c) {
    const std::uint32_t r = root(c);
    if (r == c) {
      ++count_;
    } else {
      cells_[r].mass += cells_[c].mass;
    }
  }
  for (std::uint32_t c = 0; c < cells_.size(); ++c) {
    if (root(c) == c && cells_[c].mass > heaviest_mass_) {
      heaviest_ = c;
      heaviest_mass_ = cells_[c].mass;
    }
  }
  for (auto& cell : cell_of_particle_) {
    if (cell != kNone) cell = root(cell);
  }
}

Pose2 ParticleClusters::heaviest_mean(const ParticleSet& particles) const {
  if (heaviest_ == kNone) return circular_mean(particles);
  return sums_of(particles, cell_of_particle_, heaviest_).mean(particles.origin);
}

}  // namespace urban_gnss
