#include "urban_gnss_localization/simulation/receiver.hpp"

#include <cmath>
#include <limits>

namespace urban_gnss {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

enum Stream : std::uint64_t { kClock = 1, kVelocity = 2, kLatency = 3, kFirstSatellite = 1000 };

double rounded(double value, double step) { return step > 0.0 ? step * std::round(value / step) : value; }

LookAngles reported(const LookAngles& look, double resolution_rad) {
  double azimuth_rad = rounded(wrap_angle(look.azimuth_rad), resolution_rad);
  if (azimuth_rad < 0.0) azimuth_rad += 2.0 * kPi;
  return {azimuth_rad, rounded(look.elevation_rad, resolution_rad)};
}

/// Standard deviation that the receiver believes of a range: that of noise, by C/N0 alone.
double believed_sigma_m(double cn0_dbhz, const ReceiverParameters& parameters) {
  return parameters.uere * std::pow(10.0, 0.05 * (parameters.sigma_cn0 - cn0_dbhz));
}

Eigen::Vector3d draw_vector(RandomEngine& engine) {
  const double x = draw_normal(engine);
  const double y = draw_normal(engine);
  const double z = draw_normal(engine);
  return {x, y, z};
}

}  // namespace

void ReceiverParameters::check(std::vector<std::string>& faults) const {
  if (!(latency_min <= latency_max)) faults.push_back("latency_min: must be at most latency_max");
}

std::vector<SatelliteObservation> to_observations(const std::vector<SatelliteReport>& reports) {
  std::vector<SatelliteObservation> observations;
  for (const SatelliteReport& report : reports) {
    SatelliteObservation observation;
    observation.id = report.id;
    observation.look = report.look;
    observation.cn0_dbhz = report.cn0_dbhz;
    observation.tracked = report.is_tracked;
    observation.residual_m = report.residual_m;
    observations.push_back(observation);
  }
  return observations;
}

Receiver::Receiver(const ReceiverParameters& parameters, std::uint64_t seed)
    : parameters_(parameters),
      seed_(seed),
      clock_engine_(make_engine(seed, kClock)),
      velocity_engine_(make_engine(seed, kVelocity)),
      latency_engine_(make_engine(seed, kLatency)) {}

ReceiverEpoch Receiver::epoch(double interval_s, const Eigen::Vector3d& antenna, const Eigen::Vector3d& velocity,
                              const std::vector<ReceivedSatellite>& satellites) {
  ++epoch_;
  ReceiverEpoch result;
  result.hdop = kNaN;
  result.latency_s =
      parameters_.latency_min + (parameters_.latency_max - parameters_.latency_min) * draw_uniform(latency_engine_);
  const Eigen::Vector3d velocity_noise = draw_vector(velocity_engine_);
  if (filtered_) *filtered_ += last_velocity_ * interval_s;

  track(interval_s, satellites, result.satellites);
  const std::vector<RangeMeasurement> measurements = measure(interval_s, satellites, result.satellites);
  std::optional<AltitudePrior> prior;
  if (filtered_ && parameters_.altitude_prior_sigma > 0.0) {
    prior = AltitudePrior{filtered_->z() - antenna.z(), parameters_.altitude_prior_sigma};
  }
  const auto solution = solve_position(measurements, prior);
  if (!solution || solution->hdop > parameters_.max_hdop) {
    without_solution_s_ += interval_s;
    if (without_solution_s_ > parameters_.coasting_time) filtered_.reset();
    return result;
  }
  without_solution_s_ = 0.0;
  result.used_count = solution->used_count;
  result.hdop = solution->hdop;

  int nlos_count = 0;
  std::size_t measurement = 0;
  for (const std::size_t index : measured_) {
    SatelliteReport& report = result.satellites[index];
    report.is_used = solution->used[measurement];
    report.residual_m = solution->residuals_m[measurement++];
    if (report.is_used && report.path_class == PathClass::kNlos) ++nlos_count;
  }
  const double nlos_share = static_cast<double>(nlos_count) / solution->used_count;

  ReceiverFix fix;
  const double velocity_sigma_mps = solution->hdop * parameters_.velocity_sigma;
  fix.velocity = velocity + (velocity_sigma_mps + nlos_share * parameters_.velocity_nlos_sigma) * velocity_noise;
  if (parameters_.publishes_velocity) fix.velocity_sigma_mps = velocity_sigma_mps;
  fix.position = smoothed(interval_s, antenna + solution->position);
  refer_residuals(measurements, fix.position - antenna - solution->position, result.satellites);
  const double horizontal_m = parameters_.uere * solution->hdop;
  const double vertical_m = parameters_.uere * solution->vdop;
  fix.covariance = Eigen::Array3d(horizontal_m, horizontal_m, vertical_m).square().matrix().asDiagonal();
  if (!parameters_.declares_covariance) fix.covariance_type = CovarianceType::kUnknown;
  last_velocity_ = fix.velocity;
  result.fix = fix;
  return result;
}

void Receiver::track(double interval_s, const std::vector<ReceivedSatellite>& satellites,
                     std::vector<SatelliteReport>& reports) {
  reports.reserve(satellites.size());
  for (const ReceivedSatellite& satellite : satellites) {
    Channel& channel = channel_of(satellite.id);
    channel.last_epoch = epoch_;
    const ChannelOutput output = channel.channel.step(interval_s, satellite, parameters_.channel, channel.engine);
    SatelliteReport report;
    report.id = satellite.id;
    report.look = reported(satellite.look, parameters_.angle_resolution);
    report.is_tracked = output.is_tracked;
    report.residual_m = kNaN;
    report.path_class = output.path_class;
    report.cn0_dbhz = output.is_tracked ? std::round(output.cn0_dbhz) : kNaN;
    report.range_error_m = output.is_tracked ? output.range_error_m : kNaN;
    report.excess_m = output.is_tracked ? output.excess_m : kNaN;
    reports.push_back(report);
  }
  for (auto channel = channels_.begin(); channel != channels_.end();) {
    channel = channel->second.last_epoch == epoch_ ? std::next(channel) : channels_.erase(channel);
  }
}

std::vector<RangeMeasurement> Receiver::measure(double interval_s, const std::vector<ReceivedSatellite>& satellites,
                                                const std::vector<SatelliteReport>& reports) {
  for (auto& [constellation, clock_m] : clocks_m_) {
    clock_m += parameters_.clock_walk * std::sqrt(interval_s) * draw_normal(clock_engine_);
  }
  std::vector<RangeMeasurement> measurements;
  measured_.clear();
  for (std::size_t i = 0; i < reports.size(); ++i) {
    if (!reports[i].is_tracked || satellites[i].look.elevation_rad < parameters_.elevation_mask) continue;
    RangeMeasurement measurement;
    measurement.constellation = reports[i].id.constellation;
    measurement.line_of_sight = satellites[i].line_of_sight;
    measurement.range_m = reports[i].range_error_m + clocks_m_[measurement.constellation];
    measurement.sigma_m = believed_sigma_m(reports[i].cn0_dbhz, parameters_);
    measurements.push_back(measurement);
    measured_.push_back(i);
  }
  return measurements;
}

void Receiver::refer_residuals(const std::vector<RangeMeasurement>& measurements, const Eigen::Vector3d& moved,
                               std::vector<SatelliteReport>& reports) const {
  struct ClockFit {
    double weighted_m{0.0};
    double weight{0.0};
  };
  std::map<Constellation, ClockFit> clocks;
  for (std::size_t i = 0; i < measurements.size(); ++i) {
    SatelliteReport& report = reports[measured_[i]];
    if (!report.is_used) continue;
    report.residual_m += measurements[i].line_of_sight.dot(moved);
    const double weight = 1.0 / (measurements[i].sigma_m * measurements[i].sigma_m);
    ClockFit& clock = clocks[measurements[i].constellation];
    clock.weighted_m += weight * report.residual_m;
    clock.weight += weight;
  }
  for (std::size_t i = 0; i < measurements.size(); ++i) {
    SatelliteReport& report = reports[measured_[i]];
    if (!report.is_used) continue;
    const ClockFit& clock = clocks.at(measurements[i].constellation);
    report.residual_m -= clock.weighted_m / clock.weight;
  }
}

Receiver::Channel& Receiver::channel_of(const SatelliteId& id) {
  const auto found = channels_.find(id);
  if (found != channels_.end()) return found->second;
  const auto stream = kFirstSatellite + 1000 * static_cast<std::uint64_t>(id.constellation) + id.svid;
  RandomEngine engine = make_engine(seed_, stream);
  SatelliteChannel channel(parameters_.channel, engine);
  return channels_.emplace(id, Channel{engine, channel, epoch_}).first->second;
}

Eigen::Vector3d Receiver::smoothed(double interval_s, const Eigen::Vector3d& solution) {
  if (!filtered_ || parameters_.smoothing_time == 0.0) {
    filtered_ = solution;
  } else {
    *filtered_ += (1.0 - std::exp(-interval_s / parameters_.smoothing_time)) * (solution - *filtered_);
  }
  return *filtered_;
}

}  // namespace urban_gnss
