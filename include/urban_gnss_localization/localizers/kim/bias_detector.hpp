#pragma once

#include <Eigen/Core>

#include "urban_gnss_localization/common/parameters.hpp"

namespace urban_gnss {

struct BiasDetectorParameters {
  double gate_probability{0.99};
  double ramp_slack{0.5};
  double ramp_threshold{8.0};

  void visit(ParameterVisitor& v) {
    v("gate_probability", gate_probability, between(0.5, 0.999999), "",
      "probability that an unbiased fix is classified as unbiased, 2 DOF");
    v("ramp_slack", ramp_slack, non_negative(), "sigma per fix",
      "drift of the innovations that the CUSUM test ignores");
    v("ramp_threshold", ramp_threshold, positive(), "sigma",
      "CUSUM of the innovations at which they are taken to drift; 8 with a ramp_slack of 0.5: one false alarm in 7800 "
      "fixes");
  }
};

/// The threshold of Kim et al. section 4.2 for the NIS, as printed: the 95 % quantile for three degrees of freedom.
inline constexpr double kPrintedThreshold = 7.81;

/// What the tests say of one innovation.
struct BiasDetection {
  double nis{0.0};      ///< normalised innovation squared, chi-squared with 2 degrees of freedom without a bias
  bool is_jump{false};  ///< the NIS is above its quantile
  bool is_ramp{false};  ///< the innovations have drifted in one direction
  bool is_biased() const { return is_jump || is_ramp; }
};

/// Detection of a biased fix (Kim et al. section 4.2), with the quantile for the two degrees of freedom of a horizontal
/// fix.
///
/// Beside the NIS of one fix it watches the sequence of innovations: two-sided CUSUMs (Page 1954) of their whitened
/// components find a bias that grows slowly, with each step below the gate.
class BiasDetector {
 public:
  /// Requires parameters without faults.
  explicit BiasDetector(const BiasDetectorParameters& parameters);

  /// Takes one innovation (m, map frame) with the covariance (m^2) that it has without a bias. Covariance positive
  /// definite.
  BiasDetection test(const Eigen::Vector2d& innovation, const Eigen::Matrix2d& covariance);

  /// Forgets the run of innovations, as after a jump of the estimate.
  void reset();

  double threshold() const { return threshold_; }
  const Eigen::Vector4d& sums() const { return sums_; }  ///< CUSUM of +east, -east, +north, -north, sigma

 private:
  BiasDetectorParameters parameters_;
  double threshold_;
  Eigen::Vector4d sums_{Eigen::Vector4d::Zero()};
};

/// NIS of an innovation: its squared Mahalanobis length. Covariance positive definite.
double normalised_innovation_squared(const Eigen::Vector2d& innovation, const Eigen::Matrix2d& covariance);

/// The length (m) of a sudden bias that a gate at `gate_probability` finds at the first fix with probability `power`,
/// in the direction in which it is hardest to find. `covariance` (m^2) is the innovation's: declared covariance of the
/// fix plus that of the short-horizon prediction. A jump below this is likely to be fused before it is noticed; it then
/// moves the estimate by its gain, and the CUSUM has to find it. Throws std::invalid_argument unless both
/// probabilities are in (0, 1) and the covariance is positive definite.
double smallest_detectable_jump(const Eigen::Matrix2d& covariance, double gate_probability, double power = 0.9);

}  // namespace urban_gnss
