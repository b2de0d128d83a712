#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "urban_gnss_localization/common/parameters.hpp"
#include "urban_gnss_localization/common/stamp.hpp"

namespace urban_gnss {

struct ReceiverSmoothingParameters {
  double receiver_smoothing_time{8.0};
  double receiver_coasting_time{3.0};

  void visit(ParameterVisitor& v) {
    v("receiver_smoothing_time", receiver_smoothing_time, non_negative(), "s",
      "time constant of the receiver's smoothing, for which an error outlasts its cause");
    v("receiver_coasting_time", receiver_coasting_time, non_negative(), "s",
      "time without a solution after which the receiver's smoothing starts anew");
  }
};

/// What is left in a receiver's fix of the errors before it; the soft form of the recovery in Algorithm 3 of Maier and
/// Kleiner 2010. The receiver's output is taken to be a first-order low-pass of its solutions, with T =
/// receiver_smoothing_time, so its error is
///   f_k = a f_{k-1} + (1 - a) e_k,   a = exp(-interval / T).
/// An error e with mean b and covariance V has the same recursion in its mean. For the rest, e_k = b_k + V_k^(1/2) z
/// with one z for all times: errors of reflections stay for some time, and where they do not, this is an upper bound
/// (Minkowski's inequality, in every direction). So the low-passes B of b and S of V^(1/2), the symmetric root, give
/// the second moment S S + B B^T. White errors are smoothed to less: sigma_ure is meant to be that of a smoothed fix.
class ReceiverSmoothing {
 public:
  /// Requires parameters without faults.
  explicit ReceiverSmoothing(const ReceiverSmoothingParameters& parameters) : parameters_(parameters) {}

  /// Second moment of the error of the fix at `stamp`, m^2, whose solution alone has this mean error (m) and covariance
  /// (m^2, positive semidefinite). Starts anew after receiver_coasting_time without a solution, and where the stamp is
  /// not newer than the last.
  Eigen::Matrix2d add(Stamp stamp, const Eigen::Vector2d& mean, const Eigen::Matrix2d& covariance);

  void reset() { last_.reset(); }

 private:
  ReceiverSmoothingParameters parameters_;
  std::optional<Stamp> last_;
  // Where there is a last stamp:
  Eigen::Vector2d mean_{Eigen::Vector2d::Zero()};
  Eigen::Matrix2d root_{Eigen::Matrix2d::Identity()};
};

}  // namespace urban_gnss
