#include "urban_gnss_localization/experiments/paper_experiment.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

#include "urban_gnss_localization/localizers/switching/imm_ekf.hpp"
#include "urban_gnss_localization/localizers/switching/switching_particle_filter.hpp"
#include "urban_gnss_localization/parameters/parameter_reader.hpp"
#include "urban_gnss_localization/pipeline/bias_pipeline.hpp"

namespace urban_gnss {
namespace {

double distance_to_polygon(const Eigen::Vector2d& point, const std::vector<Eigen::Vector2d>& corners) {
  double nearest = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const Eigen::Vector2d& a = corners[i];
    const Eigen::Vector2d side = corners[(i + 1) % corners.size()] - a;
    const double along = std::clamp((point - a).dot(side) / side.squaredNorm(), 0.0, 1.0);
    nearest = std::min(nearest, (point - a - along * side).norm());
  }
  return nearest;
}

PoseEstimate start_estimate(const PaperFieldParameters& field) {
  PoseEstimate start;
  start.pose = field.start();
  const double p2 = field.start_position_sigma * field.start_position_sigma;
  const double h2 = field.start_heading_sigma * field.start_heading_sigma;
  start.covariance = Eigen::Vector3d(p2, p2, h2).asDiagonal();
  return start;
}

constexpr std::uint64_t kStartStream = 201;

/// The estimator of one run: any of the methods behind the two calls that the loop makes.
class Estimator {
 public:
  Estimator(PaperMethod::Kind kind, const PaperExperimentConditions& conditions)
      : kind_(kind), field_(conditions.field), bias_(conditions.bias) {
    const PoseEstimate start = start_estimate(conditions.field);
    if (kind_ == PaperMethod::Kind::kDeadReckoning) {
      // As uncertain of its start as one particle.
      RandomEngine engine = make_engine(static_cast<std::uint64_t>(conditions.field.seed), kStartStream);
      ParticleSet single(1);
      single.draw_gaussian(start, engine);
      dead_reckoned_ = single.pose(0);
      return;
    }
    filter_ = make_filter(conditions);
    particle_filter_ = dynamic_cast<const ParticleLocalizer*>(filter_.get());
    filter_->initialize(start);
  }

  void move(const Twist2& twist, double duration_s) {
    dead_reckoned_ = urban_gnss::move(dead_reckoned_, twist, duration_s);
    if (filter_) filter_->move(twist, duration_s);
  }

  void correct(const SimulatedFix& fix, double time_s) {
    if (!filter_ || (kind_ == PaperMethod::Kind::kOracleZone && fix.in_shadow)) return;
    FixMeasurement measurement;
    measurement.position = fix.position;
    measurement.time_s = time_s;
    double sigma = field_.fix_direct_sigma;
    if (kind_ == PaperMethod::Kind::kOracle) {
      measurement.position -= fix.bias;
      if (fix.in_shadow) sigma = field_.fix_shadow_sigma;
    }
    measurement.covariance = sigma * sigma * Eigen::Matrix2d::Identity();
    if (filter_->wants_bias()) {
      LocalFix local{from_seconds(time_s), fix.position, measurement.covariance};
      const BiasEstimate& bias = bias_.process(local, filter_->pose().position());
      radius_ = bias.radius_m;
      if (is_rejected(bias.outcome.decision)) return;
    }
    measurement.bias_radius_m = radius_;
    filter_->correct(measurement);
  }

  Pose2 pose() const { return filter_ ? filter_->pose() : dead_reckoned_; }
  double radius() const { return radius_; }
  double effective_sample_size() const { return particle_filter_ ? particle_filter_->effective_sample_size() : 0.0; }
  const ParticleSet* particles() const { return particle_filter_ ? &particle_filter_->particles() : nullptr; }

 private:
  std::unique_ptr<Localizer> make_filter(const PaperExperimentConditions& conditions) const {
    switch (kind_) {
      case PaperMethod::Kind::kImm:
        return std::make_unique<ImmEkf>(conditions.switching.model, conditions.switching_motion);
      case PaperMethod::Kind::kSwitching:
        return std::make_unique<SwitchingParticleFilter>(conditions.switching, conditions.switching_motion);
      default: return std::make_unique<ParticleFilter>(conditions.filter, conditions.filter_motion);
    }
  }

  PaperMethod::Kind kind_;
  PaperFieldParameters field_;
  BiasTracker bias_;
  std::unique_ptr<Localizer> filter_;
  const ParticleLocalizer* particle_filter_{nullptr};  ///< filter_, where it is one
  Pose2 dead_reckoned_;
  double radius_{0.0};
};

void make_oracle(PaperExperimentConditions& c) {
  c.filter.mode = ParticleFilterMode::kConventional;
  c.filter.likelihood = LikelihoodChoice::kProduct;
  c.filter.fix.use_fix_covariance = true;
}

}  // namespace

PaperExperimentConditions read_paper_conditions(const YAML::Node& files) {
  PaperExperimentConditions conditions;
  std::vector<std::string> faults;
  const auto read = [&](const std::string& name, auto&&... structs) {
    ParameterReader reader(files[name], "", name + ".", Layout::kTiered);
    reader.ignore("field");  // which simulation the simulator's node runs
    (reader.read(structs), ...);
    const auto found = reader.finish();
    faults.insert(faults.end(), found.begin(), found.end());
  };
  read("simulator", WithMotion{conditions.field, conditions.field_motion});
  read("particle_filter", WithMotion{conditions.filter, conditions.filter_motion});
  read("switching_particle_filter", WithMotion{conditions.switching, conditions.switching_motion});
  BiasPipelineParameters bias_node;  // the file is the node's, which has more than the filter
  read("gps_bias", bias_node);
  conditions.bias = bias_node.bias;
  read("waypoint_controller", conditions.controller);
  if (!faults.empty()) throw ParameterError("the paper's field", faults);
  conditions.controller.targets = conditions.field.targets();
  return conditions;
}

const std::vector<PaperMethod>& paper_methods() {
  using Kind = PaperMethod::Kind;
  static const std::vector<PaperMethod> methods = {
      {"literal", Kind::kFilter, "proposed filter, the text as printed",
       [](auto& c) {
         c.filter.mode = ParticleFilterMode::kLiteral;
         c.bias.mode = ParticleFilterMode::kLiteral;
       }},
      {"paper", Kind::kFilter, "proposed filter, the reading that works",
       [](auto& c) { c.filter.mode = ParticleFilterMode::kPaper; }},
      {"paper_ring_1", Kind::kFilter, "paper with a ring of 1 %",
       [](auto& c) {
         c.filter.mode = ParticleFilterMode::kPaper;
         c.filter.ring_share = 0.01;
       }},
      {"paper_sum", Kind::kFilter, "paper with one-dimensionally normalised sums as likelihood",
       [](auto& c) {
         c.filter.mode = ParticleFilterMode::kPaper;
         c.filter.likelihood = LikelihoodChoice::kSum;
       }},
      {"conventional", Kind::kFilter, "conventional filter, eq. (46) and (47) as printed",
       [](auto& c) { c.filter.mode = ParticleFilterMode::kConventional; }},
      {"conventional_product", Kind::kFilter, "conventional filter with the product likelihood",
       [](auto& c) {
         c.filter.mode = ParticleFilterMode::kConventional;
         c.filter.likelihood = LikelihoodChoice::kProduct;
       }},
      {"switching", Kind::kSwitching, "switching bias, Rao-Blackwellized particle filter", [](auto&) {}},
      {"imm_ekf", Kind::kImm, "switching bias, interacting multiple models", [](auto&) {}},
      {"dead_reckoning", Kind::kDeadReckoning, "the inputs alone", [](auto&) {}},
      {"oracle_zone", Kind::kOracleZone, "knows the shadow and drops the fix there", make_oracle},
      {"oracle", Kind::kOracle, "knows the shadow and the bias", make_oracle},
  };
  return methods;
}

void run_paper_experiment(const PaperMethod& method, PaperExperimentConditions conditions,
                          const PaperObserver& observer) {
  method.configure(conditions);
  conditions.controller.laps = conditions.laps;
  PaperField field(conditions.field, conditions.field_motion);
  WaypointController controller(conditions.controller, 1);  // the robot starts on the first target
  Estimator estimator(method.kind, conditions);

  const double lap_length = 2.0 * kPi * conditions.field.target_ring_radius;
  const double interval = conditions.field.interval;
  const auto longest = static_cast<int>(1.5 * conditions.laps * lap_length / conditions.controller.speed / interval);
  const auto target_count = static_cast<int>(controller.targets().size());
  for (int k = 1; k <= longest && !controller.finished(); ++k) {
    const BicycleInput input = controller.steer(conditions.closed_loop ? estimator.pose() : field.truth());
    field.step(input);
    const double time_s = k * interval;
    estimator.move({input.speed_mps, yaw_rate(input, conditions.filter_motion.wheelbase)}, interval);

    PaperStep step;
    step.fix = field.fix();
    estimator.correct(step.fix, time_s);
    step.time_s = time_s;
    step.lap = static_cast<int>(controller.targets_reached()) / target_count;
    step.truth = field.truth();
    step.estimate = estimator.pose();
    step.radius_m = estimator.radius();
    step.effective_sample_size = estimator.effective_sample_size();
    step.cross_track_m = distance_to_polygon(step.truth.position(), controller.targets());
    observer(step, estimator.particles());
  }
}

}  // namespace urban_gnss
