#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <vector>

#include "urban_gnss_localization/common/parameters.hpp"
#include "urban_gnss_localization/simulation/wall_index.hpp"
#include "urban_gnss_localization/simulation/world.hpp"

namespace urban_gnss {

inline constexpr int kMaxReflections = 6;

/// How a satellite's signal gets to an antenna among buildings.
struct SignalParameters {
  double reflection_range{120.0};
  int max_reflections{6};
  int max_directions{128};
  double polarisation_loss{6.0};
  double trunk_loss{10.0};
  double max_loss{24.0};

  void visit(ParameterVisitor& v) {
    v("reflection_range", reflection_range, positive(), "m",
      "horizontal: reflections farther from the antenna are not sought");
    v("max_reflections", max_reflections, between(0, kMaxReflections), "",
      "longest chain of walls; 0 turns reflections off");
    v("max_directions", max_directions, at_least(1), "",
      "The lengths of chains sought are limited to those for which the walls near the antenna mirror the line of sight "
      "into at most so many directions: a grid city has 4 whatever the length, k directions of walls have about "
      "k^length");
    v("polarisation_loss", polarisation_loss, non_negative(), "dB",
      "of an odd number of reflections at an antenna made for the right-handed wave");
    v("trunk_loss", trunk_loss, non_negative(), "", "dB");
    v("max_loss", max_loss, positive(), "dB", "weaker paths are left out");
  }
};

/// A path by specular reflection at one or more walls.
struct Reflection {
  double excess_m{0.0};  ///< longer than the line of sight would be, > 0
  double loss_db{0.0};
  int count{0};                                         ///< of walls
  std::array<Eigen::Vector3d, kMaxReflections> points;  ///< m, map frame; the first `count`, from the antenna outwards
};

/// All ways of one satellite's signal to the antenna.
struct SignalPaths {
  bool is_blocked{false};  ///< the line of sight meets a building
  /// The signal of the line of sight, or, where it is blocked, what comes over the roofs' edges, can be used: it is not
  /// cut off by the roof of a tunnel and its loss is at most max_loss.
  bool has_direct{true};
  double loss_db{0.0};                            ///< of that signal: diffraction and foliage
  double excess_m{0.0};                           ///< of the way over the worst edge; 0 where the line of sight is free
  Eigen::Vector3d edge{Eigen::Vector3d::Zero()};  ///< m, map frame: where that way meets the edge, if is_blocked
  std::vector<Reflection> reflections;
};

/// Finds the paths of signals among the buildings and trees of a world. Buildings reflect on their walls and diffract
/// at their roofs' edges; trees attenuate the line of sight (and the way over an edge, as if it were straight), but not
/// reflections. Diffraction at vertical edges, reflections on the ground and on roofs, and reflections of diffracted
/// signals are left out.
///
/// Blocked is what WallIndex::cast() says. Diffraction: each wall under, or up to the roof over, the line of sight is a
/// knife edge (ITU-R P.526) across the vertical plane of the line of sight, however oblique it stands; the edge of the
/// largest parameter alone counts, which is too little loss behind several roofs of the same height. A wall whose base
/// is above the line of sight (a bridge) is none.
///
/// Reflections: for a source at infinity the image method is a reversed ray. It leaves the antenna along the line of
/// sight mirrored at some walls' directions in turn, is reflected by whatever walls it meets, and is a path if it
/// leaves the city along the line of sight. There are few such directions of departure (4 in a grid city, whatever the
/// number of reflections), and each gives at most one path. This finds every chain of at most max_reflections walls
/// with its points within reflection_range. In chains of two and more, directions of walls that differ by less than
/// 1e-3 rad count as one, and the ray that leaves may differ as much from the line of sight for each reflection.
///
/// Not thread-safe (it keeps scratch memory); no allocation once its and the output's vectors have grown.
class SignalTracer {
 public:
  /// `world` and `index` must outlive the tracer and belong together. Requires parameters without faults.
  SignalTracer(const World& world, const WallIndex& index, const SignalParameters& parameters);

  /// The paths to `antenna` (m, map frame) from the direction of the unit vector `line_of_sight` (east, north, up); one
  /// that is not above the horizon is blocked. Reuses the memory of `paths`.
  void trace(const Eigen::Vector3d& antenna, const Eigen::Vector3d& line_of_sight, SignalPaths& paths);

  const SignalParameters& parameters() const { return parameters_; }

 private:
  struct NearWall {
    int wall;
    double distance_m;  ///< of the antenna from the wall's plane, positive in front of it
  };

  void trace_direct(const Eigen::Vector3d& antenna, const Eigen::Vector3d& line_of_sight, SignalPaths& paths);
  double foliage_loss_db(const Eigen::Vector3d& antenna, const Eigen::Vector3d& line_of_sight) const;
  void find_near_walls(const Eigen::Vector2d& antenna);
  void reflect_once(const Eigen::Vector3d& antenna, const Eigen::Vector3d& line_of_sight, SignalPaths& paths) const;
  void reflect_repeatedly(const Eigen::Vector3d& antenna, const Eigen::Vector3d& line_of_sight,
                          SignalPaths& paths) const;
  void find_mirrors();
  /// Follows the reversed ray that leaves the antenna along `departure`. Returns the wall that it meets first, or
  /// nothing where it is no path of 1 to `max_count` reflections.
  std::optional<int> follow(const Eigen::Vector3d& antenna, const Eigen::Vector3d& line_of_sight,
                            const Eigen::Vector3d& departure, int max_count, Reflection& reflection) const;

  const World& world_;
  const WallIndex& index_;
  SignalParameters parameters_;
  double highest_roof_m_{0.0};
  std::vector<Eigen::Vector2d> facings_;  ///< the directions that walls have, unit normals
  std::vector<int> facing_of_wall_;
  std::optional<Eigen::Vector2d> near_what_;  ///< the antenna for which the near walls were found
  std::vector<NearWall> near_walls_;          ///< within reflection_range
  std::vector<int> near_facings_;             ///< of these, each once, ascending
  std::vector<WallIndex::Crossing> crossings_;
  std::vector<int> mirrored_facings_;     ///< the near facings for which the mirrors were found
  std::vector<Eigen::Matrix2d> mirrors_;  ///< products of mirrors at near facings, each once, the identity first
  int longest_chain_{0};                  ///< whose mirrors are all among these
};

}  // namespace urban_gnss
