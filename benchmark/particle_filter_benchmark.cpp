// The cost of one step of the particle filters and of their parts. Read the paper mode's step against the interval of
// the odometry (10 ms in the paper's field).
//
//   particle_filter_benchmark --benchmark_min_time=0.5

#include <benchmark/benchmark.h>

#include <memory>
#include <random>

#include "urban_gnss_localization/localizers/nishida/bias_kalman_filter.hpp"
#include "urban_gnss_localization/localizers/nishida/particle_filter.hpp"
#include "urban_gnss_localization/localizers/switching/switching_particle_filter.hpp"

namespace urban_gnss {
namespace {

constexpr Twist2 kTwist{10.0, 0.6};
constexpr double kStep_s = 0.01;

MotionParameters paper_motion(MotionModel model = MotionModel::kBicycle) {
  MotionParameters motion;
  motion.motion_model = model;
  motion.odom_alpha1 = motion.odom_alpha3 = motion.odom_alpha5 = 3.0;
  motion.odom_alpha2 = motion.odom_alpha4 = motion.odom_alpha6 = 0.3;
  motion.odom_noise_scale = 1e-6;
  motion.odom_noise_interval = kStep_s;
  return motion;
}

/// A cloud of 0.3 m about the origin whose weights differ.
ParticleSet cloud(std::size_t count) {
  RandomEngine engine = make_engine(1);
  PoseEstimate start;
  start.covariance = Eigen::Vector3d(0.09, 0.09, 0.0025).asDiagonal();
  ParticleSet particles(count);
  particles.draw_gaussian(start, engine);
  for (float& lw : particles.log_weight) lw = static_cast<float>(2.0 * draw_normal(engine));
  particles.normalise();
  return particles;
}

void count_particles(benchmark::State& state) { state.SetItemsProcessed(state.iterations() * state.range(0)); }

FixSigmaParameters known_sigmas() { return {false, 0.05, 0.316}; }

/// One step of odometry and a fix, in a shadow.
template <class Filter, class Parameters>
void run_steps(benchmark::State& state, Parameters parameters) {
  parameters.cluster_cell = 0.5;
  const auto filter = std::make_unique<Filter>(parameters, paper_motion());
  filter->initialize({});
  Pose2 truth;
  FixMeasurement fix;
  fix.covariance = 0.0025 * Eigen::Matrix2d::Identity();
  fix.bias_radius_m = 2.0;
  for (auto _ : state) {
    truth = move(truth, kTwist, kStep_s);
    filter->move(kTwist, kStep_s);
    fix.position = truth.position() + Eigen::Vector2d(2.0, 0.0);
    fix.time_s += kStep_s;
    benchmark::DoNotOptimize(filter->correct(fix));
  }
  state.counters["particles"] = static_cast<double>(filter->particles().size());
}

void BM_PaperStep(benchmark::State& state) {
  ParticleFilterParameters parameters;
  parameters.particle_count = static_cast<int>(state.range(0));
  parameters.fix = known_sigmas();
  run_steps<ParticleFilter>(state, parameters);
}
BENCHMARK(BM_PaperStep)->Arg(1000)->Arg(10000)->Arg(100000)->Unit(benchmark::kMicrosecond);

/// With as many particles as are plausible.
void BM_SwitchingStep(benchmark::State& state) {
  SwitchingParticleFilterParameters parameters;
  parameters.model.fix = known_sigmas();
  run_steps<SwitchingParticleFilter>(state, parameters);
}
BENCHMARK(BM_SwitchingStep)->Unit(benchmark::kMicrosecond);

/// The switching filter with all the particles that it may have: a heading that is not known.
std::unique_ptr<ParticleLocalizer> all_headings(PoseEstimate& start) {
  start.covariance = Eigen::Vector3d(1.0, 1.0, 4.0).asDiagonal();
  auto filter = std::make_unique<SwitchingParticleFilter>(SwitchingParticleFilterParameters{}, paper_motion());
  filter->initialize(start);
  return filter;
}

void BM_SwitchingMoveAll(benchmark::State& state) {
  PoseEstimate start;
  const auto filter = all_headings(start);
  for (auto _ : state) filter->move(kTwist, kStep_s);
  state.counters["particles"] = static_cast<double>(filter->particles().size());
}
BENCHMARK(BM_SwitchingMoveAll)->Unit(benchmark::kMicrosecond);

/// The start and the first fix.
void BM_SwitchingCorrectAll(benchmark::State& state) {
  PoseEstimate start;
  const auto filter = all_headings(start);
  FixMeasurement fix;
  for (auto _ : state) {
    filter->initialize(start);
    filter->move(kTwist, 1.0);
    benchmark::DoNotOptimize(filter->correct(fix));
  }
}
BENCHMARK(BM_SwitchingCorrectAll)->Unit(benchmark::kMicrosecond);

void BM_SampleMotion(benchmark::State& state) {
  ParticleSet particles = cloud(static_cast<std::size_t>(state.range(0)));
  const MotionStep step = make_motion_step(kTwist, kStep_s, paper_motion(static_cast<MotionModel>(state.range(1))));
  RandomEngine engine = make_engine(2);
  for (auto _ : state) sample_motion(particles, step, RandomStream(engine()));
  state.SetLabel(enum_name(step.model));
  count_particles(state);
}
BENCHMARK(BM_SampleMotion)
    ->ArgsProduct({{1000, 10000}, {int(MotionModel::kBicycle), int(MotionModel::kVelocity)}})
    ->Unit(benchmark::kMicrosecond);

/// The plain reference that sample_motion is compared with.
void BM_MoveNoisilyLoop(benchmark::State& state) {
  ParticleSet particles = cloud(static_cast<std::size_t>(state.range(0)));
  const MotionStep step = make_motion_step(kTwist, kStep_s, paper_motion(static_cast<MotionModel>(state.range(1))));
  RandomEngine engine = make_engine(2);
  for (auto _ : state) {
    for (std::size_t i = 0; i < particles.size(); ++i) {
      particles.set_pose(i, move_noisily(particles.pose(i), step, draw_motion_noise(engine)));
    }
  }
  state.SetLabel(enum_name(step.model));
  count_particles(state);
}
BENCHMARK(BM_MoveNoisilyLoop)
    ->ArgsProduct({{1000, 10000}, {int(MotionModel::kBicycle), int(MotionModel::kVelocity)}})
    ->Unit(benchmark::kMicrosecond);

FixLikelihood shadowed_fix(const Pose2& truth = {}) {
  FixLikelihood fix;
  fix.fix = truth.position() + Eigen::Vector2d(2.0, 0.0);
  fix.radius = 2.0;
  fix.direct_covariance *= 0.0025;
  fix.shadow_sigma = 0.316;
  return fix;
}

/// A step of odometry and the weights after a fix in the shadow, by the likelihood of the mode `paper`; weights are
/// equal before, as after resampling.
void BM_PredictAndWeigh(benchmark::State& state) {
  ParticleSet particles = cloud(static_cast<std::size_t>(state.range(0)));
  const MotionStep step = make_motion_step(kTwist, kStep_s, paper_motion(static_cast<MotionModel>(state.range(1))));
  RandomEngine engine = make_engine(2);
  Pose2 truth;
  for (auto _ : state) {
    truth = move(truth, kTwist, kStep_s);
    particles.set_equal_weights();
    sample_motion(particles, step, RandomStream(engine()));
    particles.recentre(truth.position());
    weigh(particles, shadowed_fix(truth));
    particles.normalise();
    benchmark::DoNotOptimize(particles.weight.data());
  }
  state.SetLabel(enum_name(step.model));
  count_particles(state);
}
BENCHMARK(BM_PredictAndWeigh)
    ->ArgsProduct({{1000, 10000, 100000, 1000000}, {int(MotionModel::kBicycle), int(MotionModel::kVelocity)}})
    ->Unit(benchmark::kMicrosecond);

/// The same as most would write it, like amcl: a struct for each particle, and the distributions of the standard
/// library.
struct PlainParticle {
  Pose2 pose;
  double weight{0.0};
};

std::vector<PlainParticle> plain_cloud(std::size_t count) {
  const ParticleSet particles = cloud(count);
  std::vector<PlainParticle> plain(count);
  for (std::size_t i = 0; i < count; ++i) plain[i] = {particles.pose(i), particles.weight[i]};
  return plain;
}

void BM_PredictAndWeighStructs(benchmark::State& state) {
  std::vector<PlainParticle> particles = plain_cloud(static_cast<std::size_t>(state.range(0)));
  const MotionStep step = make_motion_step(kTwist, kStep_s, paper_motion(static_cast<MotionModel>(state.range(1))));
  const double share = 1.0 / static_cast<double>(particles.size());
  std::mt19937 engine(2);
  std::normal_distribution<double> normal;
  Pose2 truth;
  for (auto _ : state) {
    truth = move(truth, kTwist, kStep_s);
    const FixLikelihood fix = shadowed_fix(truth);
    const double direct_variance = fix.direct_covariance(0, 0);
    const double shadow_variance = fix.shadow_sigma * fix.shadow_sigma;
    double sum = 0.0;
    for (PlainParticle& particle : particles) {
      MotionNoise noise;
      noise.speed = normal(engine);
      noise.input = normal(engine);
      noise.yaw_rate = normal(engine);
      particle.pose = move_noisily(particle.pose, step, noise);
      const double distance2 = (particle.pose.position() - fix.fix).squaredNorm();
      const double from_ring = std::sqrt(distance2) - fix.radius;
      const double direct = std::exp(-0.5 * distance2 / direct_variance) / (2.0 * kPi * direct_variance);
      const double shadow = std::exp(-0.5 * from_ring * from_ring / shadow_variance) /
                            (std::sqrt(2.0 * kPi * shadow_variance) * 2.0 * kPi * fix.radius);
      particle.weight = share * (0.5 * direct + 0.5 * shadow);
      sum += particle.weight;
    }
    for (PlainParticle& particle : particles) particle.weight /= sum;
    benchmark::DoNotOptimize(particles.data());
  }
  state.SetLabel(enum_name(step.model));
  count_particles(state);
}
BENCHMARK(BM_PredictAndWeighStructs)
    ->ArgsProduct({{1000, 10000, 100000, 1000000}, {int(MotionModel::kBicycle), int(MotionModel::kVelocity)}})
    ->Unit(benchmark::kMicrosecond);

void BM_Weigh(benchmark::State& state) {
  const ParticleSet original = cloud(static_cast<std::size_t>(state.range(0)));
  ParticleSet particles = original;
  FixLikelihood fix = shadowed_fix();
  fix.form = static_cast<LikelihoodForm>(state.range(1));
  fix.with_heading = fix.form != LikelihoodForm::kProduct;
  for (auto _ : state) {
    particles.log_weight = original.log_weight;
    weigh(particles, fix);
    benchmark::DoNotOptimize(particles.log_weight.data());
  }
  state.SetLabel(enum_name(fix.form));
  count_particles(state);
}
BENCHMARK(BM_Weigh)
    ->ArgsProduct({{1000, 10000},
                   {int(LikelihoodForm::kPrinted), int(LikelihoodForm::kSum), int(LikelihoodForm::kProduct)}})
    ->Unit(benchmark::kMicrosecond);

/// What the estimate takes: effective sample size, clusters, mean pose of the heaviest, covariance about it.
void BM_Estimate(benchmark::State& state) {
  const ParticleSet particles = cloud(static_cast<std::size_t>(state.range(0)));
  ParticleClusters clusters(particles.size(), 0.1);
  for (auto _ : state) {
    benchmark::DoNotOptimize(effective_sample_size(particles));
    clusters.find(particles);
    benchmark::DoNotOptimize(covariance_about(particles, clusters.heaviest_mean(particles)));
  }
  count_particles(state);
}
BENCHMARK(BM_Estimate)->Arg(1000)->Arg(10000)->Arg(100000)->Unit(benchmark::kMicrosecond);

void BM_Clusters(benchmark::State& state) {
  const ParticleSet particles = cloud(static_cast<std::size_t>(state.range(0)));
  ParticleClusters clusters(particles.size(), 0.1);
  for (auto _ : state) {
    clusters.find(particles);
    benchmark::DoNotOptimize(clusters.heaviest_mean(particles));
  }
  count_particles(state);
}
BENCHMARK(BM_Clusters)->Arg(1000)->Arg(10000)->Arg(100000)->Unit(benchmark::kMicrosecond);

void BM_Resampling(benchmark::State& state) {
  const ParticleSet original = cloud(static_cast<std::size_t>(state.range(0)));
  ParticleSet particles = original;
  const auto scheme = static_cast<ResamplingScheme>(state.range(1));
  Resampler resampler(particles.size(), scheme);
  RandomEngine engine = make_engine(3);
  for (auto _ : state) {
    particles.weight = original.weight;
    resampler.resample(particles, RandomStream(engine()));
    benchmark::DoNotOptimize(particles.x.data());
  }
  state.SetLabel(enum_name(scheme));
  count_particles(state);
}
BENCHMARK(BM_Resampling)
    ->ArgsProduct({{1000, 10000}, {int(ResamplingScheme::kMultinomial), int(ResamplingScheme::kSystematic)}})
    ->Unit(benchmark::kMicrosecond);

/// The same as most would write it.
void BM_ResamplingDiscreteDistribution(benchmark::State& state) {
  const std::vector<PlainParticle> original = plain_cloud(static_cast<std::size_t>(state.range(0)));
  std::vector<PlainParticle> particles(original.size());
  std::vector<double> weights(original.size());
  std::mt19937 engine(3);
  for (auto _ : state) {
    for (std::size_t i = 0; i < weights.size(); ++i) weights[i] = original[i].weight;
    std::discrete_distribution<std::size_t> draw(weights.begin(), weights.end());
    for (PlainParticle& particle : particles) {
      particle = original[draw(engine)];
      particle.weight = 1.0 / static_cast<double>(particles.size());
    }
    benchmark::DoNotOptimize(particles.data());
  }
  count_particles(state);
}
BENCHMARK(BM_ResamplingDiscreteDistribution)->Arg(1000)->Arg(10000)->Unit(benchmark::kMicrosecond);

void BM_BiasKalmanStep(benchmark::State& state) {
  BiasKalmanFilter filter;
  const Eigen::Matrix2d noise = 0.1 * Eigen::Matrix2d::Identity();
  const Eigen::Vector2d measurement(1.0, 2.0);
  for (auto _ : state) {
    filter.predict(kStep_s, 100.0);
    filter.correct(filter.innovation(measurement, noise), noise);
    benchmark::DoNotOptimize(filter.state.data());
  }
}
BENCHMARK(BM_BiasKalmanStep);

}  // namespace
}  // namespace urban_gnss
