#include "urban_gnss_localization/gnss/dilution_of_precision.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>

namespace urban_gnss {
namespace {

constexpr double kSmallestEigenvalue = 1e-10;

bool contributes(const RangingSatellite& satellite) {
  return satellite.weight > 0.0 && std::isfinite(satellite.weight) && satellite.line_of_sight.allFinite();
}

/// The information about the position, and what it was summed from.
struct Information {
  Eigen::Matrix3d position{Eigen::Matrix3d::Zero()};
  double weight{0.0};
  std::size_t satellites{0};
  std::size_t clocks{0};
};

/// Adds the satellites of one clock, freed of it. Centring before squaring keeps the digits that the difference of two
/// sums of squares would lose when the satellites stand close together.
template <class Iterator>
void add_clock(Iterator first, Iterator last, Information& information) {
  double weight = 0.0;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (Iterator s = first; s != last; ++s) {
    weight += s->weight;
    mean += s->weight * s->line_of_sight;
  }
  mean /= weight;
  for (Iterator s = first; s != last; ++s) {
    const Eigen::Vector3d centred = s->line_of_sight - mean;
    information.position += s->weight * centred * centred.transpose();
  }
  information.weight += weight;
  information.satellites += static_cast<std::size_t>(last - first);
  ++information.clocks;
}

}  // namespace

std::optional<DilutionOfPrecision> dilution_of_precision(const std::vector<RangingSatellite>& satellites) {
  std::vector<RangingSatellite> used;
  used.reserve(satellites.size());
  std::copy_if(satellites.begin(), satellites.end(), std::back_inserter(used), contributes);
  std::stable_sort(used.begin(), used.end(),
                   [](const RangingSatellite& a, const RangingSatellite& b) { return a.clock < b.clock; });

  Information information;
  for (auto first = used.cbegin(); first != used.cend();) {
    const auto last = std::find_if(first, used.cend(), [&](const auto& s) { return s.clock != first->clock; });
    add_clock(first, last, information);
    first = last;
  }
  if (information.satellites < 3 + information.clocks) return std::nullopt;

  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(information.position);
  // Written so that NaN, from weights whose sum overflows, is refused, too.
  if (!(axes.eigenvalues()[0] >= kSmallestEigenvalue * information.weight)) return std::nullopt;
  DilutionOfPrecision dop;
  dop.position = axes.eigenvectors() * axes.eigenvalues().cwiseInverse().asDiagonal() * axes.eigenvectors().transpose();
  return dop;
}

std::optional<DilutionOfPrecision> dilution_of_precision(const std::vector<Eigen::Vector3d>& lines_of_sight) {
  std::vector<RangingSatellite> satellites;
  satellites.reserve(lines_of_sight.size());
  for (const Eigen::Vector3d& line_of_sight : lines_of_sight) satellites.push_back({line_of_sight});
  return dilution_of_precision(satellites);
}

Eigen::Matrix2d horizontal_covariance(const DilutionOfPrecision& dop, double sigma_ure_m) {
  return sigma_ure_m * sigma_ure_m * dop.horizontal();
}

}  // namespace urban_gnss
