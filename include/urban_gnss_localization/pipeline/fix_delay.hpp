#pragma once

#include <Eigen/Core>
#include <array>
#include <complex>
#include <optional>
#include <string>
#include <vector>

#include "urban_gnss_localization/common/parameters.hpp"
#include "urban_gnss_localization/motion/odometry_history.hpp"

namespace urban_gnss {

/// How late fixes come, beyond what their stamps say.
struct FixDelayParameters {
  std::string fix_delay{"auto"};

  void visit(ParameterVisitor& v) {
    v("fix_delay", fix_delay,
      "time in seconds by which fixes and velocities are older than their stamps say; auto: estimated from the motion "
      "over the first minutes");
  }
  void check(std::vector<std::string>& faults) const;
  bool is_auto() const { return fix_delay == "auto"; }
  /// Requires one that is not estimated, and no faults.
  double given_s() const;
};

/// A delay that motion tells, with the range in which it lies.
struct DelayEstimate {
  double delay_s{0.0};
  double least_s{0.0};
  double most_s{0.0};
};

/// Finds the delay at which vectors that a receiver measured look most like those of the odometry. The two differ by a
/// rotation and a scale, which are fitted anew in each window: neither heading nor wheel radius need be known. The
/// noise of each window is what the best fit leaves in it; a window full of reflections so says little.
class DelaySearch {
 public:
  static constexpr std::size_t kCandidates = 26;
  static constexpr double kStep_s = 0.1;
  using Vectors = std::array<std::complex<double>, kCandidates>;

  /// A measured vector (m or m/s, map frame) and those of the odometry for each delay (odometry frame); stamps ascend.
  void add(Stamp stamp, const std::complex<double>& measured, const Vectors& odometry);
  /// The odometry's frame is another one from now on.
  void begin_window() { window_ = {}; }
  /// Nothing until it is clear that there is a delay.
  std::optional<DelayEstimate> estimate() const;

 private:
  struct Window {
    std::optional<Stamp> begin;
    int count{0};
    double measured_square{0.0};
    std::array<double, kCandidates> odometry_square{};
    Vectors product{};
  };
  void close_window();

  Window window_;
  int window_count_{0};  ///< that said something
  std::array<double, kCandidates> log_likelihood_{};
};

/// Estimates the delay of a receiver from the displacements between its fixes. Its velocities are taken to be as late:
/// what phones and smoothing receivers make of theirs is no delay.
class FixDelayEstimator {
 public:
  /// Requires parameters without faults.
  explicit FixDelayEstimator(const FixDelayParameters& parameters) : parameters_(parameters) {}

  /// A fix (m, map frame), once the odometry has come to its stamp. `antenna` in the base frame (m).
  void add(Stamp stamp, const Eigen::Vector2d& position, const OdometryHistory& history,
           const Eigen::Vector2d& antenna);
  /// The odometry's history begins anew.
  void forget_odometry();
  void reset() { *this = FixDelayEstimator(parameters_); }

  /// s >= 0: as it is given, or found; 0 until it is found.
  double delay_s() const { return delay_s_; }
  /// What was found, for people, where it has changed since the last call.
  std::optional<std::string> take_news();

 private:
  struct Fix {
    Stamp stamp;
    Eigen::Vector2d position;
    DelaySearch::Vectors places;  ///< of the antenna by the odometry, m
  };
  void update();

  FixDelayParameters parameters_;
  DelaySearch search_;
  std::optional<Fix> last_;
  double delay_s_{parameters_.is_auto() ? 0.0 : parameters_.given_s()};
  std::optional<std::string> news_;
};

}  // namespace urban_gnss
