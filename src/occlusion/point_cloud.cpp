#include "urban_gnss_localization/occlusion/point_cloud.hpp"

#include <dlfcn.h>
#include <pcl/kdtree/kdtree_flann.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <limits>
#include <new>
#include <stdexcept>

#include "pcd/pcl_cloud.hpp"
#include "pcd/pcl_pcd.hpp"
#include "pcd_header.hpp"
#include "urban_gnss_localization/common/pending_file.hpp"
#include "urban_gnss_localization/occlusion/cell_bits.hpp"
#include "urban_gnss_localization/occlusion/key_index.hpp"
#include "urban_gnss_localization/occlusion/voxel_walk.hpp"

namespace urban_gnss {
namespace {

/// A function of pcl_pcd, whose library lies beside this one. Throws std::runtime_error where it cannot be loaded.
template <class Function>
Function* pcl_function(const char* name) {
  Dl_info here{};
  const bool is_known = dladdr(reinterpret_cast<const void*>(&check_pcd), &here) != 0 && here.dli_fname != nullptr;
  const auto folder = is_known ? std::filesystem::path(here.dli_fname).parent_path() : std::filesystem::path();
  void* const library = dlopen((folder / pcl_pcd::kLibrary).c_str(), RTLD_NOW | RTLD_LOCAL);
  void* const function = library != nullptr ? dlsym(library, name) : nullptr;
  if (function == nullptr) throw std::runtime_error(std::string("PCL's .pcd files: ") + dlerror());
  return reinterpret_cast<Function*>(function);
}

}  // namespace

PointCloud finite_points(const PointCloud& cloud) {
  PointCloud finite;
  finite.reserve(cloud.size());
  std::copy_if(cloud.begin(), cloud.end(), std::back_inserter(finite),
               [](const Eigen::Vector3f& point) { return point.allFinite(); });
  return finite;
}

PointCloud transformed(const PointCloud& cloud, const Eigen::Isometry3d& transform) {
  const Eigen::Isometry3f single = transform.cast<float>();
  PointCloud result(cloud.size());
  std::transform(cloud.begin(), cloud.end(), result.begin(),
                 [&](const Eigen::Vector3f& point) -> Eigen::Vector3f { return single * point; });
  return result;
}

PointCloud voxel_filtered(const PointCloud& cloud, double edge_m) {
  constexpr float kFarthestM = 1e5F;
  const double farthest = std::min<double>(kFarthestM, kMaxVoxelCoordinate * edge_m);
  const double inverse_edge = 1.0 / edge_m;
  // A hash table of bricks of 4 x 4 x 4 cubes: points one after the other are mostly in the same.
  KeyIndex index;
  std::vector<std::array<KeyIndex::Index, cell_bits::kPlaces>> bricks;  ///< each cube's place in the result
  std::array<KeyIndex::Index, cell_bits::kPlaces> empty;
  empty.fill(KeyIndex::kNone);
  VoxelCoordinates last = VoxelCoordinates::Constant(std::numeric_limits<int>::max());
  KeyIndex::Index brick = KeyIndex::kNone;
  PointCloud sums;
  std::vector<int> counts;
  for (const Eigen::Vector3f& point : cloud) {
    if (!(point.cwiseAbs().maxCoeff() < farthest) || !point.allFinite()) continue;
    const VoxelCoordinates cube = voxel_of(point.cast<double>(), inverse_edge);
    if (const VoxelCoordinates at = cell_bits::parent_of(cube); at != last) {
      last = at;
      brick = index.find_or_insert(voxel_key(at), static_cast<KeyIndex::Index>(bricks.size()));
      if (brick == bricks.size()) bricks.push_back(empty);
    }
    KeyIndex::Index& slot = bricks[brick][cell_bits::place_of(cube)];
    if (slot == KeyIndex::kNone) {
      slot = static_cast<KeyIndex::Index>(sums.size());
      sums.emplace_back(Eigen::Vector3f::Zero());
      counts.push_back(0);
    }
    sums[slot] += point;
    ++counts[slot];
  }
  for (std::size_t i = 0; i < sums.size(); ++i) sums[i] /= static_cast<float>(counts[i]);
  return sums;
}

double sample_spacing_m(const PointCloud& cloud) {
  constexpr std::size_t kSamples = 5000;
  constexpr int kNeighbours = 12;  // of which some may be copies
  constexpr std::size_t kRank = 4;
  const PointCloud finite = finite_points(cloud);
  if (finite.size() <= kRank) return 0.0;
  pcl::KdTreeFLANN<pcl::PointXYZ> tree;
  const auto points = to_pcl(finite);
  tree.setInputCloud(points);
  const std::size_t stride = finite.size() / kSamples + 1;
  std::vector<float> distances;
  std::vector<int> neighbours;
  std::vector<float> squared;
  for (std::size_t i = 0; i < finite.size(); i += stride) {
    const int found = tree.nearestKSearch((*points)[i], kNeighbours, neighbours, squared);
    PointCloud others;
    for (int k = 0; k < found && others.size() < kRank; ++k) {
      const Eigen::Vector3f& candidate = finite[static_cast<std::size_t>(neighbours[static_cast<std::size_t>(k)])];
      const auto is_copy = [&](const Eigen::Vector3f& other) { return other == candidate; };
      if (candidate == finite[i] || std::any_of(others.begin(), others.end(), is_copy)) continue;
      others.push_back(candidate);
    }
    if (others.size() == kRank) distances.push_back((others.back() - finite[i]).norm());
  }
  if (distances.empty()) return 0.0;
  const auto middle = distances.begin() + static_cast<std::ptrdiff_t>(distances.size() / 2);
  std::nth_element(distances.begin(), middle, distances.end());
  return *middle;
}

PointCloud read_pcd(const std::string& path) {
  if (check_pcd(path) == 0) return {};  // PCL looks at the first point all the same
  PointCloud cloud;
  try {
    static auto* const read = pcl_function<pcl_pcd::Read>(pcl_pcd::kRead);
    if (!read(path, cloud)) throw std::runtime_error("PCL refuses it");
  } catch (const std::bad_alloc&) {
    throw std::runtime_error(path + ": not enough memory for it");
  } catch (const std::exception& error) {
    throw std::runtime_error(path + ": cannot be read as a .pcd file: " + error.what());
  }
  return cloud;
}

void write_pcd(const std::string& path, const PointCloud& cloud) {
  if (cloud.empty()) throw std::runtime_error(path + ": an empty cloud is not written");
  static auto* const write = pcl_function<pcl_pcd::Write>(pcl_pcd::kWrite);
  PendingFile pending(path);
  if (!write(pending.path().string(), cloud)) throw pending.failure();
  pending.commit();
}

}  // namespace urban_gnss
