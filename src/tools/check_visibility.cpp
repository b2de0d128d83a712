// Compares the outcomes of a ray tracer over a point cloud with those of a table: an exact cast at the polygons of the
// buildings, and published labels.

#include <chrono>
#include <cmath>
#include <exception>
#include <filesystem>
#include <iomanip>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "command_line.hpp"
#include "csv_table.hpp"
#include "files/output_file.hpp"
#include "urban_gnss_localization/geometry/angles.hpp"
#include "urban_gnss_localization/gnss/satellite.hpp"
#include "urban_gnss_localization/occlusion/kd_tree_ray_tracer.hpp"
#include "urban_gnss_localization/occlusion/point_cloud.hpp"
#include "urban_gnss_localization/occlusion/voxel_map.hpp"
#include "urban_gnss_localization/occlusion/voxel_ray_tracer.hpp"

namespace {

using urban_gnss::CsvTable;
using urban_gnss::KdTreeRayTracer;
using urban_gnss::KdTreeRayTracerParameters;
using urban_gnss::PointCloud;
using urban_gnss::RayTracer;
using urban_gnss::VoxelMap;
using urban_gnss::VoxelRayTracer;
using urban_gnss::VoxelRayTracerParameters;

constexpr double kLeastSpacing_m = 0.01;
constexpr double kMostSpacing_m = 100.0;

struct Options {
  std::string map;
  std::string table;
  std::string json;
  std::string tracer{"voxel"};
  double spacing_m{0.0};  ///< 0: the cloud's own
  double thin_m{0.0};     ///< 0: the cloud as it is
  double edge_deg{2.0};   ///< rows whose elevation is nearer to the mask's are at an edge
  double min_range_m{1.0};
  double max_range_m{500.0};
  bool compare{false};
};

/// One satellite at one epoch.
struct Row {
  Eigen::Vector3d antenna{Eigen::Vector3d::Zero()};  ///< m, frame of the map
  urban_gnss::LookAngles look;
  double mask_rad{0.0};  ///< elevation up to which the exact cast is blocked; NaN where the table has none
  bool blocked{false};   ///< by the exact cast
  std::optional<bool> label;
};

std::optional<bool> truth_value(const CsvTable& table, std::size_t row, CsvTable::Column column) {
  const double value = table.optional_number(row, column);
  if (std::isnan(value)) return std::nullopt;
  if (value != 0.0 && value != 1.0) throw table.error(row, column, "must be 0, 1 or empty");
  return value == 1.0;
}

std::vector<Row> read_rows(const std::string& path) {
  const CsvTable table(path);
  const auto x = table.column("x");
  const auto y = table.column("y");
  const auto z = table.column("z");
  const auto azimuth = table.column("az");
  const auto elevation = table.column("el");
  const auto blocked = table.column("blocked_by_model");
  const auto mask = table.optional_column("mask_el");
  const auto label = table.optional_column("label_nlos");
  std::vector<Row> rows(table.size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    Row& row = rows[i];
    row.antenna = {table.number(i, x), table.number(i, y), table.number(i, z)};
    row.look = {table.number(i, azimuth), table.number(i, elevation)};
    row.mask_rad = table.optional_number(i, mask);
    const auto exact = truth_value(table, i, blocked);
    if (!exact) throw table.error(i, blocked, "must be 0 or 1");
    row.blocked = *exact;
    row.label = truth_value(table, i, label);
  }
  if (rows.empty()) throw std::runtime_error(path + ": no rows");
  return rows;
}

/// Outcomes counted against what should have been said; "blocked" is the positive.
struct Confusion {
  std::size_t blocked_as_blocked{0};
  std::size_t blocked_as_free{0};
  std::size_t free_as_blocked{0};
  std::size_t free_as_free{0};

  void add(bool truth, bool outcome) {
    ++(truth ? (outcome ? blocked_as_blocked : blocked_as_free) : (outcome ? free_as_blocked : free_as_free));
  }
  std::size_t total() const { return blocked_as_blocked + blocked_as_free + free_as_blocked + free_as_free; }
  /// null where nothing was counted
  nlohmann::json agreement() const {
    if (total() == 0) return nullptr;
    return static_cast<double>(blocked_as_blocked + free_as_free) / static_cast<double>(total());
  }
  nlohmann::json to_json() const {
    return {{"blocked_as_blocked", blocked_as_blocked},
            {"blocked_as_free", blocked_as_free},
            {"free_as_blocked", free_as_blocked},
            {"free_as_free", free_as_free}};
  }
};

struct Result {
  std::vector<bool> outcomes;
  double us_per_ray{0.0};
};

Result trace_all(const RayTracer& tracer, const std::vector<Row>& rows) {
  Result result;
  result.outcomes.reserve(rows.size());
  const auto begin = std::chrono::steady_clock::now();
  for (const Row& row : rows) {
    result.outcomes.push_back(tracer.trace(row.antenna, urban_gnss::line_of_sight(row.look)).blocked);
  }
  const std::chrono::duration<double, std::micro> elapsed = std::chrono::steady_clock::now() - begin;
  result.us_per_ray = elapsed.count() / static_cast<double>(rows.size());
  return result;
}

nlohmann::json score(const Result& result, const std::vector<Row>& rows, double edge_rad) {
  Confusion all;
  Confusion off_edge;
  Confusion labelled;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const Row& row = rows[i];
    all.add(row.blocked, result.outcomes[i]);
    if (std::abs(row.look.elevation_rad - row.mask_rad) > edge_rad) off_edge.add(row.blocked, result.outcomes[i]);
    if (row.label) labelled.add(*row.label, result.outcomes[i]);
  }
  return {{"rows", all.total()},
          {"agreement", all.agreement()},
          {"rows_off_edge", off_edge.total()},
          {"agreement_off_edge", off_edge.agreement()},
          {"confusion", all.to_json()},
          {"us_per_ray", result.us_per_ray},
          {"label_nlos",
           {{"rows", labelled.total()}, {"agreement", labelled.agreement()}, {"confusion", labelled.to_json()}}}};
}

/// Algorithm 2 at the cloud's resolution: one neighbour within a radius, fixed or growing with the range. That of the
/// circle about a triangle of neighbouring samples is where its two errors balance: a larger one widens the rim at
/// every edge, a smaller one lets rays through between the samples.
std::unique_ptr<RayTracer> make_kd_tree(const PointCloud& cloud, double spacing_m, const Options& options, bool grows) {
  KdTreeRayTracerParameters parameters;
  parameters.min_range = options.min_range_m;
  parameters.max_range = options.max_range_m;
  parameters.range_step = 0.5 * spacing_m;
  parameters.search_radius = spacing_m / std::sqrt(3.0);
  parameters.search_radius_slope = grows ? 0.02 : 0.0;
  parameters.search_radius_max = grows ? 2.0 * spacing_m : parameters.search_radius;
  return std::make_unique<KdTreeRayTracer>(cloud, parameters);
}

double share_equal(const std::vector<bool>& a, const std::vector<bool>& b) {
  std::size_t equal = 0;
  for (std::size_t i = 0; i < a.size(); ++i) equal += a[i] == b[i] ? 1U : 0U;
  return static_cast<double>(equal) / static_cast<double>(a.size());
}

void check_visibility(const Options& options, const urban_gnss::InputFiles& inputs) {
  PointCloud cloud = urban_gnss::finite_points(urban_gnss::read_pcd(options.map));
  if (options.thin_m > 0.0) cloud = urban_gnss::voxel_filtered(cloud, options.thin_m);
  const std::vector<Row> rows = read_rows(options.table);
  const double spacing_m = options.spacing_m > 0.0 ? options.spacing_m : urban_gnss::sample_spacing_m(cloud);
  if (!(spacing_m > 0.0)) throw std::runtime_error(options.map + ": too few points to tell their spacing");
  if (spacing_m < kLeastSpacing_m || spacing_m > kMostSpacing_m) {
    std::ostringstream text;
    text << options.map << ": its points are " << spacing_m << " m apart, not " << kLeastSpacing_m << " to "
         << kMostSpacing_m << " m; --resolution tells another spacing";
    throw std::runtime_error(text.str());
  }

  VoxelMap map(urban_gnss::voxel_map_parameters_for(spacing_m));
  map.add_points(cloud);
  VoxelRayTracerParameters parameters;
  parameters.min_range = options.min_range_m;
  parameters.max_range = options.max_range_m;
  std::vector<std::pair<std::string, std::unique_ptr<RayTracer>>> tracers;
  if (options.tracer == "voxel" || options.compare) {
    tracers.emplace_back("voxel", std::make_unique<VoxelRayTracer>(map, parameters));
  }
  if (options.tracer == "kdtree" || options.compare) {
    tracers.emplace_back("kdtree", make_kd_tree(cloud, spacing_m, options, false));
  }
  if (options.tracer == "kdtree_growing" || options.compare) {
    tracers.emplace_back("kdtree_growing", make_kd_tree(cloud, spacing_m, options, true));
  }

  nlohmann::json report;
  nlohmann::json all = nlohmann::json::object();
  std::vector<bool> of_voxel;
  std::cout << std::fixed << "tracer            agreement  off edge  us per ray\n";
  for (const auto& [name, tracer] : tracers) {
    const Result result = trace_all(*tracer, rows);
    nlohmann::json scores = score(result, rows, urban_gnss::degrees_to_radians(options.edge_deg));
    if (name == "voxel") of_voxel = result.outcomes;
    if (!of_voxel.empty()) scores["agreement_with_voxel"] = share_equal(result.outcomes, of_voxel);
    if (name == options.tracer) report = scores;
    std::cout << std::left << std::setw(18) << name << std::right << std::setw(9) << std::setprecision(4)
              << scores["agreement"].get<double>() << std::setw(10);
    if (scores["agreement_off_edge"].is_null()) {
      std::cout << '-';
    } else {
      std::cout << scores["agreement_off_edge"].get<double>();
    }
    std::cout << std::setw(12) << std::setprecision(2) << result.us_per_ray << '\n';
    all[name] = std::move(scores);
  }
  report["tracer"] = options.tracer;
  report["map_points"] = cloud.size();
  report["spacing_m"] = spacing_m;
  if (options.compare) report["tracers"] = std::move(all);
  if (!options.json.empty()) {
    urban_gnss::write_file(options.json, inputs, [&](std::ostream& file) { file << report.dump(2) << '\n'; });
  }
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  urban_gnss::CommandLine line("check_visibility",
                   "Compares a ray tracer's outcomes over a point cloud with a table of exact ones.");
  CLI::App& app = line.app();
  app.add_option("--map", options.map, "point cloud of the surroundings (.pcd)")->required()->check(CLI::ExistingFile);
  app.add_option(
         "--table", options.table,
         "CSV with stamp, x, y, z (m, antenna), az, el (rad), blocked_by_model, and if known mask_el, label_nlos")
      ->required()
      ->check(CLI::ExistingFile);
  line.add_json(options.json);
  app.add_option("--tracer", options.tracer,
                 "voxel, kdtree (Algorithm 2, fixed radius) or kdtree_growing (the paper's growing radius)")
      ->check(CLI::IsMember({"voxel", "kdtree", "kdtree_growing"}));
  app.add_option("--resolution", options.spacing_m, "spacing of the cloud's points, m; default: the cloud's own")
      ->check(CLI::Range(kLeastSpacing_m, kMostSpacing_m));
  app.add_option("--thin", options.thin_m, "keep one point of the map in each cube of this edge, m")
      ->check(CLI::Range(0.01, 100.0));
  app.add_option("--min-range", options.min_range_m, "nearer is no obstacle, m")->check(CLI::Range(0.0, 100.0));
  app.add_option("--max-range", options.max_range_m, "farther is none, m")->check(CLI::Range(100.0, 1e5));
  app.add_flag("--compare", options.compare, "trace with all tracers, and tell how far they agree");
  return line.run(argc, argv, [&] { check_visibility(options, line.inputs()); });
}
