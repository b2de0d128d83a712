#pragma once

#include <Eigen/Core>
#include <array>
#include <functional>
#include <vector>

#include "urban_gnss_localization/evaluation/trajectory.hpp"
#include "urban_gnss_localization/localizers/maier/ukf.hpp"
#include "urban_gnss_localization/pipeline/localization_pipeline.hpp"
#include "urban_gnss_localization/pipeline/occlusion_pipeline.hpp"
#include "urban_gnss_localization/simulation/scenario.hpp"

namespace urban_gnss {

/// What the comparison of Maier and Kleiner 2010, Tables I and II, depends on, the scenario aside. There are two
/// settings on the same drive: ours, and the paper's as printed, with as_printed() of map and filter. Where ours
/// differs from the nodes' defaults it follows the paper: the filter is Gaussian and published_ukf(), its yaw rate is
/// the IMU's, and the covariances are used as the models give them, also below the receiver's claim.
struct OcclusionExperimentConditions {
  OcclusionExperimentConditions() {
    occlusion.covariance.allow_smaller = true;
    ukf.outliers = OutlierPolicy::kNone;
    localization.imu.use_imu_yaw_rate = true;
    occlusion.imu_orientation.imu_heading = localization.imu_orientation.imu_heading = ImuHeadingUse::kNone;
  }

  OcclusionPipelineParameters occlusion;   ///< of our setting; model and antenna are replaced
  OcclusionPipelineParameters as_printed;  ///< likewise, of the paper's
  UkfParameters ukf = published_ukf();     ///< of our setting; the paper's is as_printed() of it
  MotionParameters motion;
  LocalizationParameters localization;  ///< datum and antenna are replaced by the scenario's
  int cloud_every{5};                   ///< of a spinning lidar's scans, one in so many goes into the maps
};

/// A covariance model in one of the settings.
struct ComparedModel {
  const char* name;
  CovarianceModel model;
  bool is_as_printed;  ///< in the paper's setting
};

/// What is compared, in the order of OcclusionRun::models. The last one of each setting turns the sky for its setting.
inline constexpr std::array<ComparedModel, 5> kComparedModels{
    {{"conventional", CovarianceModel::kConventional, false},
     {"paper", CovarianceModel::kPaper, false},
     {"soft", CovarianceModel::kSoft, false},
     {"conventional_as_printed", CovarianceModel::kConventional, true},
     {"paper_as_printed", CovarianceModel::kPaper, true}}};

/// A fix as one model weighed it, with the truth about it.
struct WeighedFix {
  Stamp stamp{0};
  Eigen::Vector2d position_m{Eigen::Vector2d::Zero()};      ///< east, north, of the antenna
  Eigen::Vector2d error_m{Eigen::Vector2d::Zero()};         ///< likewise
  Eigen::Matrix2d claimed{Eigen::Matrix2d::Identity()};     ///< by the receiver, m^2
  Eigen::Matrix2d covariance{Eigen::Matrix2d::Identity()};  ///< by the model, m^2
  bool is_good{true};                                       ///< the model's outcome
  bool has_map{false};                                      ///< map and heading were there
};

/// How the map's outcome on tracked satellites compares with their true line of sight.
struct LineOfSightTally {
  /// [has a line of sight][the map says so]; blocked_threshold divides.
  std::array<std::array<std::size_t, 2>, 2> counts{};
  std::array<double, 2> known_sum{};  ///< of the known fractions, by line of sight

  std::size_t count(bool has_line_of_sight) const {
    return counts[has_line_of_sight][0] + counts[has_line_of_sight][1];
  }
};

struct OcclusionModelRun {
  std::vector<WeighedFix> fixes;
  Trajectory estimate;
  Trajectory robust_estimate;  ///< in our setting: by the same filter with OutlierPolicy::kStudentT
};

/// One drive through a scenario, every model on the same measurements. All in the scenario's map frame.
struct OcclusionRun {
  Trajectory truth;
  Trajectory odometry;  ///< alone, from the true pose when the conventional model's filter started
  std::array<LineOfSightTally, 2> satellites;  ///< in our setting, and as printed
  std::array<OcclusionModelRun, kComparedModels.size()> models;
};

/// Drives the scenario. In each setting an OcclusionPipeline builds the map and says which satellites it hides, each
/// model weighs the fixes by that, and a UKF (in ours also a robust one) uses its covariances. Nothing but the results
/// sees the truth: the filters start from fixes and motion. `on_progress` is told the share done, 0 to 1. Throws what
/// CitySimulator throws.
OcclusionRun run_occlusion_experiment(const Scenario& scenario, const OcclusionExperimentConditions& conditions,
                                      const std::function<void(double)>& on_progress);

}  // namespace urban_gnss
