#pragma once

#include <optional>
#include <string>
#include <vector>

#include "urban_gnss_localization/common/parameters.hpp"
#include "urban_gnss_localization/gnss/heading_initializer.hpp"
#include "urban_gnss_localization/motion/odometry_history.hpp"
#include "urban_gnss_localization/pipeline/pipeline_event.hpp"

namespace urban_gnss {

/// From where a localizer starts, and when it has lost its place.
struct StartParameters {
  std::vector<double> initial_pose;
  double initial_position_sigma{1.0};
  double initial_heading_sigma{0.2};
  double max_bias_radius{50.0};
  double lost_timeout{10.0};
  HeadingInitializerParameters heading;

  void visit(ParameterVisitor& v) {
    v("initial_pose", initial_pose, "m, m, rad", "initial x, y and yaw in the map frame; empty: from fixes and motion");
    v("initial_position_sigma", initial_position_sigma, non_negative(), "m per axis",
      "standard deviation of the position in initial_pose");
    v("initial_heading_sigma", initial_heading_sigma, non_negative(), "rad",
      "standard deviation of the yaw in initial_pose");
    v("max_bias_radius", max_bias_radius, positive(), "m",
      "distance of a fix from the estimate, beyond 3 standard deviations of the fix, that reflections can explain "
      "(Nishida et al.)");
    v("lost_timeout", lost_timeout, positive(), "s",
      "time with nothing but fixes farther than max_bias_radius after which the estimate is taken to be wrong");
    v.include(heading);
  }
  void check(std::vector<std::string>& faults) const;
};

/// A pose to start the localizer from.
struct Start {
  PoseEstimate estimate;  ///< base in the map frame, at the latest odometry
  std::string source;     ///< where it is from, for people
  bool has_heading{true};
  bool is_told{false};                        ///< somebody has set it: no fix and no motion stands behind it
  std::string fix_use{"used for the start"};  ///< what became of the fix that made it possible
};

/// A fix with what the start needs to know beside it.
struct StartFix {
  LocalFix fix;
  const OdometryHistory& history;  ///< holds the fix's stamp
  Eigen::Vector2d antenna;         ///< m, in the base frame
};

/// Decides when a localizer starts, and from where: from a given pose, or from fixes and motion. After a time-out it
/// starts without a heading, which is then found as soon as the robot moves. Decides when it has lost its place and
/// starts anew.
class StartSupervisor {
 public:
  /// Requires parameters without faults.
  explicit StartSupervisor(const StartParameters& parameters);

  bool has_started() const { return has_started_; }
  bool has_heading() const { return !heading_is_unknown_; }
  /// It had started, and its place is not known any more.
  bool is_lost() const { return is_lost_; }
  /// What the start waits for, for people.
  std::string waiting_for() const { return heading_.waiting_for(); }

  /// A pose from which to start as soon as there are datum and odometry. Throws std::invalid_argument where the pose or
  /// the covariance is not finite.
  void give(const PoseEstimate& pose);
  const std::optional<PoseEstimate>& given() const { return given_; }

  /// The receiver's velocity beside the odometry's.
  void add_velocity(const VelocityPair& pair) { heading_.add_velocity(pair); }

  /// Before the start: takes a fix into account. Returns the start that it makes possible.
  std::optional<Start> find_start(const StartFix& fix);
  /// After the start: takes a fix into account. Returns a new start where the last one had no heading and there is one
  /// now, or where the place is lost, or fixes contradict the estimate for long, and the fixes and the motion agree
  /// with each other. `predicted`: of the antenna at the fix's stamp (m, map frame), by the localizer.
  std::optional<Start> find_restart(const StartFix& fix, const Eigen::Vector2d& predicted, bool is_contradicted,
                                    std::vector<PipelineEvent>& events);

  /// The stamp of the last fix that was remembered.
  const std::optional<Stamp>& remembered() const { return last_remembered_; }
  /// The antenna's pose at that fix by fixes and motion alone, whatever the localizer says; nothing where they do not
  /// tell it.
  std::optional<PoseEstimate> by_motion() const { return heading_.estimate(); }

  /// The localizer was started from `start`.
  void note(const Start& start);
  /// The place is unknown. Forgets what fixes and motion said of it until now.
  void lose_place();

  void reset() { *this = StartSupervisor(parameters_); }

 private:
  /// Whether the fix is one of those that the start is found from.
  bool remember(const StartFix& fix);
  std::optional<Start> from_motion(const StartFix& fix) const;
  static Start at_latest_odometry(PoseEstimate antenna, const StartFix& fix);
  /// Whether every fix of the last lost_timeout is too far from the estimate.
  bool is_lost_by(const LocalFix& fix, const Eigen::Vector2d& predicted, std::vector<PipelineEvent>& events);

  StartParameters parameters_;
  HeadingInitializer heading_;
  std::optional<Stamp> last_remembered_;  ///< of the fixes that the start is found from
  std::optional<PoseEstimate> given_;     ///< until it is used
  bool has_started_{false};
  bool heading_is_unknown_{false};  ///< the last start had none
  bool is_lost_{false};
  std::optional<Stamp> far_since_;  ///< every fix has been farther than max_bias_radius
};

}  // namespace urban_gnss
