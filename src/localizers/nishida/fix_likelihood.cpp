#include "urban_gnss_localization/localizers/nishida/fix_likelihood.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "urban_gnss_localization/common/vector_math.hpp"

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

/// The constants of (27) and (31) as a product.
struct ProductConstants {
  explicit ProductConstants(const FixLikelihood& fix)
      : inverse_covariance(fix.direct_covariance.inverse()),
        norm_direct(-std::log(2.0 * kPi) - 0.5 * std::log(fix.direct_covariance.determinant())),
        norm_shadow(-0.5 * std::log(2.0 * kPi * fix.shadow_sigma * fix.shadow_sigma) -
                    std::log(2.0 * kPi * std::max(fix.radius, fix.shadow_sigma))) {}

  Eigen::Matrix2d inverse_covariance;
  double norm_direct;
  double norm_shadow;
};

/// The plain form of the likelihood, with the constants of one fix, computed once for all particles.
class Evaluator {
 public:
  explicit Evaluator(const FixLikelihood& fix)
      : fix_(fix),
        product_(fix),
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
    const Eigen::Matrix2d& inverse = product_.inverse_covariance;
    const double mahalanobis2 = inverse(0, 0) * dx * dx + 2.0 * inverse(0, 1) * dx * dy + inverse(1, 1) * dy * dy;
    double result = product_.norm_direct - 0.5 * mahalanobis2;
    if (fix_.with_shadow) {
      const double z = d_ring / fix_.shadow_sigma;
      result = std::log(0.5) + log_add(result, product_.norm_shadow - 0.5 * z * z);
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
  ProductConstants product_;
  double sigma_x_;
  double sigma_y_;
  bool has_offset_;
  double norm_x_;
  double norm_y_;
  double norm_shadow_;
  double norm_heading_;
};

/// The array form of Evaluator with the product, without allocation.
URBAN_GNSS_VECTORISED void weigh_by_product(ParticleSet& particles, const FixLikelihood& fix) {
  const ProductConstants constants(fix);
  const Eigen::Matrix2d& inverse = constants.inverse_covariance;
  const bool has_offset = fix.antenna_in_body.squaredNorm() > 0.0;
  const auto fix_x = static_cast<float>(fix.fix.x() - particles.origin.x());
  const auto fix_y = static_cast<float>(fix.fix.y() - particles.origin.y());
  const auto ahead = static_cast<float>(fix.antenna_in_body.x());
  const auto left = static_cast<float>(fix.antenna_in_body.y());
  const auto half_xx = static_cast<float>(0.5 * inverse(0, 0));
  const auto half_yy = static_cast<float>(0.5 * inverse(1, 1));
  const auto xy = static_cast<float>(inverse(0, 1));
  const auto norm_direct = static_cast<float>(constants.norm_direct + (fix.with_shadow ? std::log(0.5) : 0.0));
  const auto norm_shadow = static_cast<float>(constants.norm_shadow + std::log(0.5));
  const auto norm_heading = static_cast<float>(log_normal(0.0, fix.heading_sigma));
  const auto radius = static_cast<float>(fix.radius);
  const auto inverse_shadow_sigma = static_cast<float>(1.0 / fix.shadow_sigma);
  const auto inverse_heading_sigma = static_cast<float>(1.0 / fix.heading_sigma);
  const auto heading = static_cast<float>(fix.fix_heading);

  constexpr std::size_t kBlock = 256;
  float dx[kBlock], dy[kBlock];
  for (std::size_t first = 0; first < particles.size(); first += kBlock) {
    const std::size_t count = std::min(kBlock, particles.size() - first);
    const float* __restrict const x = particles.x.data() + first;
    const float* __restrict const y = particles.y.data() + first;
    const float* __restrict const yaw = particles.yaw.data() + first;
    float* __restrict const log_weight = particles.log_weight.data() + first;
    for (std::size_t i = 0; i < count; ++i) {
      dx[i] = x[i] - fix_x;  // (28)
      dy[i] = y[i] - fix_y;  // (29)
    }
    if (has_offset) {
      for (std::size_t i = 0; i < count; ++i) {
        const SineCosine direction = vector_sincos(yaw[i]);
        dx[i] += direction.cosine * ahead - direction.sine * left;
        dy[i] += direction.sine * ahead + direction.cosine * left;
      }
    }
    if (fix.with_shadow) {
      for (std::size_t i = 0; i < count; ++i) {
        const float direct = norm_direct - (half_xx * dx[i] * dx[i] + xy * dx[i] * dy[i] + half_yy * dy[i] * dy[i]);
        const float z = (std::sqrt(dx[i] * dx[i] + dy[i] * dy[i]) - radius) * inverse_shadow_sigma;  // (32)
        const float shadow = norm_shadow - 0.5F * z * z;
        const float larger = direct > shadow ? direct : shadow;
        log_weight[i] += larger + vector_log(1.0F + vector_exp(-std::abs(direct - shadow)));  // (33)
      }
    } else {
      for (std::size_t i = 0; i < count; ++i) {
        log_weight[i] += norm_direct - (half_xx * dx[i] * dx[i] + xy * dx[i] * dy[i] + half_yy * dy[i] * dy[i]);
      }
    }
    if (fix.with_heading) {
      for (std::size_t i = 0; i < count; ++i) {
        const float z = vector_wrap(yaw[i] - heading) * inverse_heading_sigma;  // (30)
        log_weight[i] += norm_heading - 0.5F * z * z;
      }
    }
  }
}

}  // namespace

EnumNames<LikelihoodForm> enum_names(LikelihoodForm) {
  return {{"printed", LikelihoodForm::kPrinted}, {"sum", LikelihoodForm::kSum}, {"product", LikelihoodForm::kProduct}};
}

double log_likelihood(const Pose2& pose, const FixLikelihood& fix) { return Evaluator(fix)(pose.x, pose.y, pose.yaw); }

void weigh(ParticleSet& particles, const FixLikelihood& fix) {
  if (fix.form == LikelihoodForm::kProduct) {
    weigh_by_product(particles, fix);
    return;
  }
  const Evaluator evaluate(fix);
  for (std::size_t i = 0; i < particles.size(); ++i) {
    const Pose2 pose = particles.pose(i);
    particles.log_weight[i] += static_cast<float>(evaluate(pose.x, pose.y, pose.yaw));
  }
}

double fix_heading(const Eigen::Vector2d& fix, const Eigen::Vector2d& last_position, double turn_since_rad) {
  const Eigen::Vector2d way = fix - last_position;
  return wrap_angle(std::atan2(way.y(), way.x()) + turn_since_rad);
}

}  // namespace urban_gnss
