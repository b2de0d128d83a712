#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <string>
#include <vector>

namespace urban_gnss {

/// Points in metres; the frame is said where a cloud is passed. May hold non-finite points until finite_points().
using PointCloud = std::vector<Eigen::Vector3f>;

/// The points whose three coordinates are finite, in their order.
PointCloud finite_points(const PointCloud& cloud);

PointCloud transformed(const PointCloud& cloud, const Eigen::Isometry3d& transform);

/// One point, the centroid, for each cube of `edge_m` > 0 that holds any, in the order in which the cubes are first
/// met. Leaves out non-finite points and those farther than 100 km from the origin.
PointCloud voxel_filtered(const PointCloud& cloud, double edge_m);

/// The distance between neighbouring samples of the cloud's surfaces, m: the median over (at most 5000) points of the
/// distance to the fourth nearest other point. That is the step of a square grid of samples, and 1.13/sqrt(density) of
/// randomly placed ones. Copies of a point, such as two walls' common corner, count once. 0 for fewer than five points.
double sample_spacing_m(const PointCloud& cloud);

/// Reads the x, y, z of a .pcd file of any encoding. Throws std::runtime_error that names the file.
PointCloud read_pcd(const std::string& path);

/// Writes a binary .pcd file. Throws std::runtime_error that names the file.
void write_pcd(const std::string& path, const PointCloud& cloud);

}  // namespace urban_gnss
