#pragma once

#include <cstdint>
#include <vector>

#include "urban_gnss_localization/localizers/particle_set.hpp"

namespace urban_gnss {

/// Eq. (39), the effective sample size: the number of equally weighted particles with the same information. Requires
/// normalised weights.
double effective_sample_size(const ParticleSet& particles);

/// Eq. (35) with the mean angle taken on the circle. Requires normalised weights.
Pose2 circular_mean(const ParticleSet& particles);

/// Eq. (35) to the letter: the angles, as numbers in [-pi, pi), are averaged like lengths.
Pose2 arithmetic_mean(const ParticleSet& particles);

/// Weighted covariance about `mean` (m^2, m rad, rad^2), the angle's differences taken on the circle.
Eigen::Matrix3d covariance_about(const ParticleSet& particles, const Pose2& mean);

/// Circular standard deviation of the heading, sqrt(-2 ln R), rad; infinite for a uniform heading.
double circular_sigma(const ParticleSet& particles);

/// Particles grouped by position: occupied cells of a grid that touch (also at a corner) belong together. O(N), without
/// allocation after the first call.
class ParticleClusters {
 public:
  /// `cell_m` > 0: particles farther apart than two cells without others between are in different clusters.
  ParticleClusters(std::size_t particle_count, double cell_m);

  /// Finds the clusters. Requires normalised weights; particles of less than a thousandth of the mean weight are left
  /// out, so that a few of no importance bridge nothing. Requires no more particles than at construction.
  void find(const ParticleSet& particles);

  std::uint32_t count() const { return count_; }
  /// Weight of the heaviest cluster, 0 to 1.
  double heaviest_mass() const { return heaviest_mass_; }
  bool is_in_heaviest(std::size_t particle) const {
    return heaviest_ != kNone && cell_of_particle_[particle] == heaviest_;
  }
  /// Mean pose of the heaviest cluster (angle on the circle).
  Pose2 heaviest_mean(const ParticleSet& particles) const;

 private:
  struct Cell {
    std::int64_t column{0};
    std::int64_t row{0};
    std::uint32_t parent{0};
    double mass{0.0};
  };
  static constexpr std::uint32_t kNone = 0xFFFFFFFFU;

  std::size_t slot_of(std::int64_t column, std::int64_t row) const;
  std::uint32_t root(std::uint32_t cell);

  double cell_m_;
  std::vector<std::uint32_t> table_;  ///< open addressing: index into cells_, or kNone
  std::vector<Cell> cells_;
  std::vector<std::uint32_t> cell_of_particle_;
  std::uint32_t heaviest_{kNone};
  double heaviest_mass_{0.0};
  std::uint32_t count_{0};
};

}  // namespace urban_gnss
