#include "urban_gnss_localization/localizers/nishida/estimation.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace urban_gnss {
namespace {

/// Sums from which a weighted mean pose with its angle on the circle follows.
struct PoseSums {
  double weight{0.0}, x{0.0}, y{0.0}, cosine{0.0}, sine{0.0};

  void add(const ParticleSet& p, std::size_t i) {
    const double w = p.weight[i];
    weight += w;
    x += w * p.x[i];
    y += w * p.y[i];
    cosine += w * std::cos(p.yaw[i]);
    sine += w * std::sin(p.yaw[i]);
  }
  Pose2 mean() const { return {x / weight, y / weight, std::atan2(sine, cosine)}; }
};

PoseSums sums_of(const ParticleSet& particles) {
  PoseSums sums;
  for (std::size_t i = 0; i < particles.size(); ++i) sums.add(particles, i);
  return sums;
}

}  // namespace

double effective_sample_size(const ParticleSet& particles) {
  double squares = 0.0;
  for (const double w : particles.weight) squares += w * w;
  return 1.0 / squares;
}

Pose2 circular_mean(const ParticleSet& particles) { return sums_of(particles).mean(); }

Pose2 arithmetic_mean(const ParticleSet& particles) {
  Pose2 mean;
  for (std::size_t i = 0; i < particles.size(); ++i) {
    mean.x += particles.weight[i] * particles.x[i];
    mean.y += particles.weight[i] * particles.y[i];
    mean.yaw += particles.weight[i] * particles.yaw[i];
  }
  return mean;
}

Eigen::Matrix3d covariance_about(const ParticleSet& particles, const Pose2& mean) {
  double xx = 0.0, xy = 0.0, yy = 0.0, xt = 0.0, yt = 0.0, tt = 0.0;
  for (std::size_t i = 0; i < particles.size(); ++i) {
    const double w = particles.weight[i];
    const double dx = particles.x[i] - mean.x;
    const double dy = particles.y[i] - mean.y;
    const double dt = angle_difference(particles.yaw[i], mean.yaw);
    xx += w * dx * dx;
    xy += w * dx * dy;
    yy += w * dy * dy;
    xt += w * dx * dt;
    yt += w * dy * dt;
    tt += w * dt * dt;
  }
  Eigen::Matrix3d covariance;
  covariance << xx, xy, xt, xy, yy, yt, xt, yt, tt;
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
  PoseSums sums;
  for (std::size_t i = 0; i < particles.size(); ++i) {
    if (is_in_heaviest(i)) sums.add(particles, i);
  }
  return sums.weight > 0.0 ? sums.mean() : circular_mean(particles);
}

}  // namespace urban_gnss
