#include "urban_gnss_localization/localizers/kim/bias_detector.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <boost/math/distributions/non_central_chi_squared.hpp>
#include <cmath>
#include <stdexcept>

#include "urban_gnss_localization/gnss/chi_squared.hpp"

namespace urban_gnss {

double normalised_innovation_squared(const Eigen::Vector2d& innovation, const Eigen::Matrix2d& covariance) {
  return innovation.dot(covariance.ldlt().solve(innovation));
}

BiasDetector::BiasDetector(const BiasDetectorParameters& parameters)
    : parameters_(parameters), threshold_(chi_squared_quantile(parameters.gate_probability, kFixDof)) {}

void BiasDetector::reset() { sums_.setZero(); }

BiasDetection BiasDetector::test(const Eigen::Vector2d& innovation, const Eigen::Matrix2d& covariance) {
  const Eigen::Vector2d whitened = covariance.llt().matrixL().solve(innovation);
  BiasDetection detection;
  detection.nis = whitened.squaredNorm();
  detection.is_jump = detection.nis > threshold_;

  // A jump is the other test's business, and one spike shall not count as a drift.
  if (!detection.is_jump) {
    const Eigen::Vector4d steps(whitened.x(), -whitened.x(), whitened.y(), -whitened.y());
    sums_ = (sums_ + steps - Eigen::Vector4d::Constant(parameters_.ramp_slack)).cwiseMax(0.0);
    detection.is_ramp = sums_.maxCoeff() > parameters_.ramp_threshold;
    if (detection.is_ramp) sums_.setZero();
  }
  return detection;
}

double smallest_detectable_jump(const Eigen::Matrix2d& covariance, double gate_probability, double power) {
  if (!(gate_probability > 0.0 && gate_probability < 1.0 && power > 0.0 && power < 1.0)) {
    throw std::invalid_argument("smallest_detectable_jump: probabilities must be between 0 and 1");
  }
  const Eigen::Vector2d axes = Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(covariance).eigenvalues();
  if (!(axes.minCoeff() > 0.0) || !axes.allFinite()) {
    throw std::invalid_argument("smallest_detectable_jump: covariance must be positive definite");
  }
  // With a bias the NIS is non-central chi-squared; its non-centrality is the bias's squared Mahalanobis length.
  const double threshold = chi_squared_quantile(gate_probability, kFixDof);
  if (power <= 1.0 - gate_probability) return 0.0;
  using Distribution = boost::math::non_central_chi_squared;
  const double non_centrality = Distribution::find_non_centrality(kFixDof, threshold, 1.0 - power);
  return std::sqrt(non_centrality * axes.maxCoeff());
}

}  // namespace urban_gnss
