#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <limits>
#ifdef __SSE2__
#include <emmintrin.h>
#endif

namespace urban_gnss {

/// Whole-number coordinates of a cube in a grid.
using VoxelCoordinates = Eigen::Vector3i;

/// Coordinates are packed into 21 bits each.
constexpr int kMaxVoxelCoordinate = (1 << 20) - 2;

/// The floor of a number that fits an int, without the call that std::floor is on a machine of no given kind.
inline int floor_to_int(double value) {
  const int towards_zero = static_cast<int>(value);
  return towards_zero - static_cast<int>(value < towards_zero);
}

inline VoxelCoordinates voxel_of(const Eigen::Vector3d& point, double inverse_edge) {
  return {floor_to_int(point.x() * inverse_edge), floor_to_int(point.y() * inverse_edge),
          floor_to_int(point.z() * inverse_edge)};
}

inline std::uint64_t voxel_key(int x, int y, int z) {
  constexpr std::int64_t offset = kMaxVoxelCoordinate + 1;
  return static_cast<std::uint64_t>(x + offset) | static_cast<std::uint64_t>(y + offset) << 21U |
         static_cast<std::uint64_t>(z + offset) << 42U;
}
inline std::uint64_t voxel_key(const VoxelCoordinates& voxel) { return voxel_key(voxel.x(), voxel.y(), voxel.z()); }

inline VoxelCoordinates voxel_of_key(std::uint64_t key) {
  constexpr int offset = kMaxVoxelCoordinate + 1;
  const auto part = [key](unsigned shift) { return static_cast<int>(key >> shift & 0x1FFFFFU) - offset; };
  return {part(0), part(21), part(42)};
}

/// Where a ray meets the next face across each axis, and the choice of the nearest; of equals that of the last axis.
/// Which it is cannot be foretold, and a jump that is foretold wrongly costs more than all the rest: where the machine
/// has masks, they choose.
#ifdef __SSE2__
class NextFaces {
 public:
  NextFaces(const double* next_m, const double* stride_m)
      : x_(_mm_set_sd(next_m[0])),
        y_(_mm_set_sd(next_m[1])),
        z_(_mm_set_sd(next_m[2])),
        x_stride_(_mm_set_sd(stride_m[0])),
        y_stride_(_mm_set_sd(stride_m[1])),
        z_stride_(_mm_set_sd(stride_m[2])) {}

  double nearest_m() const { return _mm_cvtsd_f64(_mm_min_sd(_mm_min_sd(x_, y_), z_)); }
  void pass_nearest(VoxelCoordinates& voxel, const int* step) {
    const __m128d is_x_before_y = _mm_cmplt_sd(x_, y_);
    const __m128d is_x = _mm_and_pd(is_x_before_y, _mm_cmplt_sd(x_, z_));
    const __m128d is_y = _mm_andnot_pd(is_x_before_y, _mm_cmplt_sd(y_, z_));
    const __m128d is_not_z = _mm_or_pd(is_x, is_y);
    voxel.x() += low_bits(is_x) & step[0];
    voxel.y() += low_bits(is_y) & step[1];
    voxel.z() += ~low_bits(is_not_z) & step[2];
    x_ = _mm_add_sd(x_, _mm_and_pd(is_x, x_stride_));
    y_ = _mm_add_sd(y_, _mm_and_pd(is_y, y_stride_));
    z_ = _mm_add_sd(z_, _mm_andnot_pd(is_not_z, z_stride_));
  }

 private:
  static int low_bits(__m128d mask) { return _mm_cvtsi128_si32(_mm_castpd_si128(mask)); }

  __m128d x_, y_, z_;
  __m128d x_stride_, y_stride_, z_stride_;
};
#else
class NextFaces {
 public:
  NextFaces(const double* next_m, const double* stride_m)
      : next_m_{next_m[0], next_m[1], next_m[2]}, stride_m_{stride_m[0], stride_m[1], stride_m[2]} {}

  double nearest_m() const { return next_m_[nearest()]; }
  void pass_nearest(VoxelCoordinates& voxel, const int* step) {
    const int axis = nearest();
    voxel[axis] += step[axis];
    next_m_[axis] += stride_m_[axis];
  }

 private:
  int nearest() const {
    return next_m_[0] < next_m_[1] ? (next_m_[0] < next_m_[2] ? 0 : 2) : (next_m_[1] < next_m_[2] ? 1 : 2);
  }

  double next_m_[3];
  double stride_m_[3];
};
#endif

/// A ray in a grid of cubes of one edge. Walks through every cube that it passes, from one to the next through their
/// common face (Amanatides & Woo 1987): none that it passes through is left out, as it would be by steps along the ray.
class GridRay {
 public:
  /// Finite arguments, a unit vector.
  GridRay(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, double edge_m)
      : origin_(origin), direction_(direction), edge_m_(edge_m) {
    for (int axis = 0; axis < 3; ++axis) {
      const double slope = direction[axis];
      step_[axis] = slope == 0.0 ? 0 : slope > 0.0 ? 1 : -1;
      stride_m_[axis] = slope == 0.0 ? std::numeric_limits<double>::infinity() : edge_m / std::abs(slope);
    }
  }

  /// Calls visit(voxel, from_m, to_m) with the ray's stretch inside each cube, from `begin_m` to `end_m`; stops where
  /// that returns false. The walk must stay within kMaxVoxelCoordinate.
  template <class Visit>
  void walk(double begin_m, double end_m, Visit&& visit) const {
    const Eigen::Vector3d start = (origin_ + begin_m * direction_) / edge_m_;
    VoxelCoordinates voxel(floor_to_int(start.x()), floor_to_int(start.y()), floor_to_int(start.z()));
    double next_m[3];
    for (int axis = 0; axis < 3; ++axis) {
      const double to_face = std::abs(voxel[axis] + (step_[axis] > 0 ? 1 : 0) - start[axis]);
      next_m[axis] = step_[axis] == 0 ? stride_m_[axis] : begin_m + to_face * stride_m_[axis];
    }
    NextFaces faces(next_m, stride_m_);
    for (double from_m = begin_m; from_m < end_m;) {
      const double face_m = faces.nearest_m();
      if (!visit(static_cast<const VoxelCoordinates&>(voxel), from_m, face_m < end_m ? face_m : end_m)) return;
      from_m = face_m;
      faces.pass_nearest(voxel, step_);
    }
  }

 private:
  Eigen::Vector3d origin_;
  Eigen::Vector3d direction_;
  double edge_m_;
  double stride_m_[3];
  int step_[3];
};

/// GridRay::walk() of a ray that is walked once.
template <class Visit>
void walk_voxels(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, double begin_m, double end_m,
                 double edge_m, Visit&& visit) {
  GridRay(origin, direction, edge_m).walk(begin_m, end_m, visit);
}

}  // namespace urban_gnss
