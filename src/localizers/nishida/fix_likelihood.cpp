#include "urban_gnss_localization/localizers/nishida/fix_likelihood.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace urban_gnss {
namespace {

double log_add(double a, double b) {
  const double larger = std::max(a, b);
  if (!std::isfinite(larger)) return larger;
  return larger + std::log1p(std::exp(-std::abs(a - b)));
}

double log_normal(double deviation, double sigma) {
  return -0.5 * deviation * deviation / (sigma * sigma) - 0.5 * std::log(2.0 * kPi * sigma * sigma);
}

/// The constants of one fix, computed once for all particles.
class Evaluator {
 public:
  explicit Evaluator(const FixLikelihood& fix)
      : fix_(fix),
        inverse_covariance_(fix.direct_covariance.inverse()),
        sigma_x_(std::sqrt(fix.direct_covariance(0, 0))),
        sigma_y_(std::sqrt(fix.direct_covariance(1, 1))),
        has_offset_(fix.antenna_in_body.squaredNorm() > 0.0) {
    const bool printed = fix.form == LikelihoodForm::kPrinted;
    // Normalisers of an exponential, in logarithms: 1/(2 pi sigma^2) as printed, 1/sqrt(2 pi sigma^2) otherwise.
    const auto log_norm = [&](double sigma) { return -(printed ? 1.0 : 0.5) * std::log(2.0 * kPi * sigma * sigma); };
    norm_x_ = std::log(2.0 / 3.0) + log_norm(sigma_x_);
    norm_y_ = std::log(2.0 / 3.0) + log_norm(sigma_y_);
    norm_shadow_ = std::log(2.0 / 3.0) + log_norm(fix.shadow_sigma);
    norm_heading_ = std::log(1.0 / 3.0) + log_norm(fix.heading_sigma);
    product_norm_direct_ = -std::log(2.0 * kPi) - 0.5 * std::log(fix.direct_covariance.determinant());
    product_norm_shadow_ = -0.5 * std::log(2.0 * kPi * fix.shadow_sigma * fix.shadow_sigma) -
                           std::log(2.0 * kPi * std::max(fix.radius, fix.shadow_sigma));
  }

  double operator()(double x, double y, double yaw) const {
    if (has_offset_) {
      const double c = std::cos(yaw);
      const double s = std::sin(yaw);
      x += c * fix_.antenna_in_body.x() - s * fix_.antenna_in_body.y();
      y += s * fix_.antenna_in_body.x() + c * fix_.antenna_in_body.y();
    }
    const double dx = x - fix_.fix.x();                                                          // (28)
    const double dy = y - fix_.fix.y();                                                          // (29)
    const double d_heading = fix_.with_heading ? angle_difference(yaw, fix_.fix_heading) : 0.0;  // (30)
    const double d_ring = fix_.with_shadow ? std::sqrt(dx * dx + dy * dy) - fix_.radius : 0.0;   // (32)
    return fix_.form == LikelihoodForm::kProduct ? product(dx, dy, d_heading, d_ring) : sum(dx, dy, d_heading, d_ring);
  }

 private:
  double product(double dx, double dy, double d_heading, double d_ring) const {
    const double mahalanobis2 = inverse_covariance_(0, 0) * dx * dx + 2.0 * inverse_covariance_(0, 1) * dx * dy +
                                inverse_covariance_(1, 1) * dy * dy;
    double result = product_norm_direct_ - 0.5 * mahalanobis2;
    if (fix_.with_shadow) {
      const double z = d_ring / fix_.shadow_sigma;
      result = std::log(0.5) + log_add(result, product_norm_shadow_ - 0.5 * z * z);
    }
    if (fix_.with_heading) result += log_normal(d_heading, fix_.heading_sigma);
    return result;
  }

  double sum(double dx, double dy, double d_heading, double d_ring) const {
    const auto exponent = [](double deviation, double sigma) { return -0.5 * deviation * deviation / (sigma * sigma); };
    double direct = log_add(norm_x_ + exponent(dx, sigma_x_), norm_y_ + exponent(dy, sigma_y_));  // (27)
    const double heading = norm_heading_ + exponent(d_heading, fix_.heading_sigma);
    if (fix_.with_heading) direct = log_add(direct, heading);
    if (!fix_.with_shadow) return direct;
    double shadow = norm_shadow_ + exponent(d_ring, fix_.shadow_sigma);  // (31)
    if (fix_.with_heading) shadow = log_add(shadow, heading);
    return std::log(0.5) + log_add(direct, shadow);  // (33)
  }

  FixLikelihood fix_;
  Eigen::Matrix2d inverse_covariance_;
  double sigma_x_;
  double sigma_y_;
  bool has_offset_;
  double norm_x_;
  double norm_y_;
  double norm_shadow_;
  double norm_heading_;
  double product_norm_direct_;
  double product_norm_shadow_;
};

}  // namespace

EnumNames<LikelihoodForm> enum_names(LikelihoodForm) {
  return {{"printed", LikelihoodForm::kPrinted}, {"sum", LikelihoodForm::kSum}, {"product", LikelihoodForm::kProduct}};
}

double log_likelihood(const Pose2& pose, const FixLikelihood& fix) { return Evaluator(fix)(pose.x, pose.y, pose.yaw); }

void weigh(ParticleSet& particles, const FixLikelihood& fix) {
  const Evaluator evaluate(fix);
  for (std::size_t i = 0; i < particles.size(); ++i) {
    particles.log_weight[i] += evaluate(particles.x[i], particles.y[i], particles.yaw[i]);
  }
}

double fix_heading(const Eigen::Vector2d& fix, const Eigen::Vector2d& last_position, double turn_since_rad) {
  const Eigen::Vector2d way = fix - last_position;
  return wrap_angle(std::atan2(way.y(), way.x()) + turn_since_rad);
}

}  // namespace urban_gnss
