#pragma once

#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "urban_gnss_localization/common/parameters.hpp"
#include "urban_gnss_localization/motion/motion_doubt.hpp"
#include "urban_gnss_localization/motion/speed_check.hpp"
#include "urban_gnss_localization/pipeline/pipeline_event.hpp"

namespace urban_gnss {

/// What is believed of the odometry's speed.
struct SpeedParameters {
  double max_acceleration{10.0};
  bool check_wheels{true};

  void visit(ParameterVisitor& v) {
    v("max_acceleration", max_acceleration, positive(), "m/s^2",
      "greatest acceleration that is believed; a speed beyond it is left out for up to 2 s");
    v("check_wheels", check_wheels,
      "whether the receiver's speed takes the place of one of the odometry that it shows to be wrong");
  }
};

/// The speed by the receiver: at one time by its velocity, or the mean of some time by its fixes.
struct ReceiverSpeed {
  Stamp stamp{0};                       ///< of the end
  double speed_mps{0.0};                ///< >= 0
  std::optional<double> forward_mps{};  ///< in the direction of the heading, where that is known
  double sigma_mps{0.0};
  double duration_s{0.0};  ///< 0: by the velocity
};

/// Where the forward speed comes from: the odometry, until SpeedCheck finds it wrong; then the receiver's velocity,
/// until both agree again. Where the receiver is silent it is the odometry's all the same, with the sign that was
/// found. While both contradict each other, and while the receiver's is used, there is a doubt. The speed by fixes is
/// filtered, for a reflection spoils them for seconds.
class SpeedSource {
 public:
  /// Requires parameters without faults.
  explicit SpeedSource(const SpeedParameters& parameters) : parameters_(parameters), doubt_(kDoubtedShare) {}

  /// Compares both speeds; stamps ascend.
  void compare(const ReceiverSpeed& receiver, std::vector<PipelineEvent>& events);
  /// The speed (m/s) of the step of `duration_s` that ends at `stamp`.
  double speed_of(double odometry_mps, Stamp stamp, double duration_s, std::vector<PipelineEvent>& events);
  /// m^2 per axis, by what the position's variance grew in the last step beyond the odometry's model.
  double doubt_m2() const { return doubt_m2_; }
  /// Another sensor contradicts the wheels, or does not any more.
  void set_wheels_contradicted(bool contradicted) { is_contradicted_ = contradicted && parameters_.check_wheels; }

  /// Whether the odometry's speed is not believed.
  bool is_wrong() const { return check_.fault() != SpeedFault::kNone || is_contradicted_; }
  /// Why the odometry's speed is not believed; empty where it is.
  std::string complaint() const;
  /// The odometry's next speed is another source's: it may differ from the last by any amount.
  void expect_jump() { last_mps_.reset(); }
  /// The estimate started anew: its heading has shown no sign yet.
  void forget_heading() { has_agreed_ = false; }
  void reset() { *this = SpeedSource(parameters_); }

 private:
  /// Of the way that only one of the two saw, the standard deviation of the one that is believed.
  static constexpr double kDoubtedShare = 0.5;

  struct Speed {
    Stamp stamp;
    double mps;
  };
  struct FilteredSpeed {
    Stamp stamp;
    double mps;
    double variance;  ///< (m/s)^2
  };
  /// By the odometry, whatever is believed of it; nothing outside of what is remembered.
  std::optional<double> odometry_at(Stamp stamp) const;
  /// The mean over the time of the receiver's speed.
  std::optional<double> odometry_beside(const ReceiverSpeed& receiver) const;
  /// The filtered speed by fixes takes the pair into account.
  void filter(const SpeedPair& pair);
  /// The receiver's speed, m/s.
  double receiver_mps() const { return is_by_fixes_ ? by_fixes_->mps : pair_.receiver_mps; }
  /// The speed that is believed.
  double believed_mps(double odometry_mps, Stamp stamp, double duration_s, std::vector<PipelineEvent>& events);
  /// m^2 per axis, of a step at the believed speed.
  double doubt_of(double odometry_mps, double believed_mps, Stamp stamp, double duration_s);
  /// Remembers what the odometry says.
  void note(double odometry_mps, Stamp stamp);
  /// Whether the receiver's speed is recent enough to be used.
  bool is_fresh(Stamp stamp) const;
  /// Leaves out a speed that no acceleration explains, for up to 2 s.
  double without_glitch(double odometry_mps, double duration_s, std::vector<PipelineEvent>& events);

  SpeedParameters parameters_;
  SpeedCheck check_;
  std::deque<Speed> odometry_;             ///< of the last seconds
  std::optional<Stamp> jumped_;            ///< when the odometry did, until a speed of the receiver came after it
  std::optional<double> last_mps_;         ///< of the odometry, that was believed
  double held_s_{0.0};                     ///< for which a speed was left out
  std::optional<double> before_jump_mps_;  ///< the speed before one that was believed after all
  bool has_agreed_{false};                 ///< with the heading's sign, while it moved
  SpeedPair shown_;                        ///< that showed the fault
  SpeedPair pair_;                         ///< that was compared last
  bool is_by_fixes_{false};                ///< the receiver's newest speed
  std::optional<FilteredSpeed> by_fixes_;
  bool is_contradicted_{false};            ///< by another sensor than the receiver
  LastingDoubt doubt_;
  double doubt_m2_{0.0};
};

}  // namespace urban_gnss
