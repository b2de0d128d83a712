#pragma once

#include <cmath>
#include <filesystem>
#include <string>

#include "files/output_file.hpp"
#include "urban_gnss_localization/experiments/occlusion_experiment.hpp"

namespace urban_gnss {

/// Writes `trajectory` as t, x, y, yaw (s since `start`, m, rad), at most five poses a second.
inline void write_trajectory(const std::filesystem::path& path, const InputFiles& inputs, const Trajectory& trajectory,
                             Stamp start) {
  constexpr Stamp kInterval = std::chrono::milliseconds(200);
  write_file(path, inputs, [&](std::ostream& out) {
    out << "t,x,y,yaw\n";
    Stamp last = start - kInterval;
    for (const TimedPose& pose : trajectory) {
      if (pose.stamp - last < kInterval) continue;
      last = pose.stamp;
      out << to_seconds(pose.stamp - start) << ',' << pose.pose.x << ',' << pose.pose.y << ',' << pose.pose.yaw << '\n';
    }
  });
}

/// What figures 5 to 7 of Maier and Kleiner 2010 show of one run: DIRECTORY/fixes_<scenario>.csv with the fixes, their
/// errors and each model's sigma_p (m) and outcome, and trajectory_<scenario>_<name>.csv. Throws what write_file
/// throws.
inline void write_series(const std::filesystem::path& directory, const InputFiles& inputs, const std::string& scenario,
                         const OcclusionRun& run) {
  if (run.truth.empty()) return;
  const Stamp start = run.truth.front().stamp;
  write_file(directory / ("fixes_" + scenario + ".csv"), inputs, [&](std::ostream& out) {
    out << "t,x,y,error,sigma_claimed";
    for (const ComparedModel& each : kComparedModels) out << ",sigma_" << each.name << ",good_" << each.name;
    out << '\n';
    const std::vector<WeighedFix>& fixes = run.models.front().fixes;
    for (std::size_t i = 0; i < fixes.size(); ++i) {
      out << to_seconds(fixes[i].stamp - start) << ',' << fixes[i].position_m.x() << ',' << fixes[i].position_m.y()
          << ',' << fixes[i].error_m.norm() << ',' << std::sqrt(fixes[i].claimed.trace());
      for (const OcclusionModelRun& model : run.models) {
        out << ',' << std::sqrt(model.fixes[i].covariance.trace()) << ',' << (model.fixes[i].is_good ? 1 : 0);
      }
      out << '\n';
    }
  });
  const auto write = [&](const std::string& name, const Trajectory& trajectory) {
    write_trajectory(directory / ("trajectory_" + scenario + "_" + name + ".csv"), inputs, trajectory, start);
  };
  write("truth", run.truth);
  write("odometry", run.odometry);
  for (std::size_t i = 0; i < kComparedModels.size(); ++i) write(kComparedModels[i].name, run.models[i].estimate);
}

}  // namespace urban_gnss
