#include "urban_gnss_localization/gnss/receiver_smoothing.hpp"

#include <Eigen/Eigenvalues>
#include <cmath>

namespace urban_gnss {

Eigen::Matrix2d ReceiverSmoothing::add(Stamp stamp, const Eigen::Vector2d& mean, const Eigen::Matrix2d& covariance) {
  const double interval_s = last_ ? to_seconds(stamp - *last_) : -1.0;
  const bool goes_on =
      interval_s > 0.0 && interval_s <= parameters_.receiver_coasting_time && parameters_.receiver_smoothing_time > 0.0;
  const double kept = goes_on ? std::exp(-interval_s / parameters_.receiver_smoothing_time) : 0.0;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> axes(covariance);
  const Eigen::Matrix2d root =
      axes.eigenvectors() * axes.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal() * axes.eigenvectors().transpose();
  mean_ = kept * mean_ + (1.0 - kept) * mean;
  root_ = kept * root_ + (1.0 - kept) * root;
  last_ = stamp;
  return root_ * root_.transpose() + mean_ * mean_.transpose();
}

}  // namespace urban_gnss
