#include "urban_gnss_localization/ros/markers.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "urban_gnss_localization/geometry/ellipse.hpp"
#include "urban_gnss_localization/pipeline/status_line.hpp"
#include "urban_gnss_localization/ros/conversions.hpp"
#include "urban_gnss_localization/ros/marker_parts.hpp"

namespace urban_gnss {
namespace {

using visualization_msgs::Marker;

/// After so many letters a line of the text breaks at the next space.
constexpr std::size_t kLineLength = 40;

std::string wrapped(std::string text) {
  std::size_t begin = 0;
  while (text.size() - begin > kLineLength) {
    const std::size_t space = text.find(' ', begin + kLineLength);
    if (space == std::string::npos) break;
    text[space] = '\n';
    begin = space + 1;
  }
  return text;
}

}  // namespace

visualization_msgs::Marker status_marker(const LocalizationReport& report, const std::string& base_link_frame) {
  const StatusLevel level = level_of(report);
  const Colour colour = level == StatusLevel::kOk     ? Colour{0.3F, 1.0F, 0.5F, 1.0F}
                        : level == StatusLevel::kWarn ? Colour{1.0F, 0.8F, 0.1F, 1.0F}
                                                      : Colour{1.0F, 0.3F, 0.3F, 1.0F};
  Marker text = make_marker("status", 0, Marker::TEXT_VIEW_FACING, colour, ros::Time(), base_link_frame);
  text.frame_locked = 1;
  // Who looks at an uncertain robot looks from afar.
  const double height_m =
      std::isfinite(report.position_sigma_m) ? std::clamp(0.8 * report.position_sigma_m, 0.7, 5.0) : 2.0;
  text.pose.position = point(0.0, 0.0, 2.0 + height_m);
  text.scale.z = height_m;
  text.text = wrapped(status_line(report));
  return text;
}

visualization_msgs::Marker ellipse_marker(const PoseEstimate& estimate, Colour colour, int id, const ros::Time& time,
                                          const std::string& map_frame) {
  constexpr int kSegments = 48;
  constexpr double kHeight_m = 0.15;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> axes(estimate.covariance.topLeftCorner<2, 2>());
  const Eigen::Vector2d radii = (kEllipse95 * axes.eigenvalues().cwiseMax(0.0)).cwiseSqrt();
  Marker ellipse = make_marker("ellipse", id, Marker::LINE_STRIP, colour, time, map_frame);
  ellipse.lifetime = ros::Duration(3.0);                             // it goes when the estimates end
  ellipse.scale.x = std::clamp(0.04 * radii.maxCoeff(), 0.05, 0.6);  // seen from afar, if it is large
  for (int i = 0; i <= kSegments; ++i) {
    const double angle = 2.0 * kPi * i / kSegments;
    const Eigen::Vector2d place =
        estimate.pose.position() +
        axes.eigenvectors() * radii.cwiseProduct(Eigen::Vector2d(std::cos(angle), std::sin(angle)));
    ellipse.points.push_back(point(place.x(), place.y(), kHeight_m));
  }
  return ellipse;
}

visualization_msgs::MarkerArray bias_markers(const BiasEstimate& bias, const std::string& map_frame) {
  constexpr int kSegments = 72;
  constexpr double kHeight_m = 0.1;
  const ros::Time time = to_ros(bias.stamp);
  const double size = std::clamp(0.1 * bias.radius_m, 0.5, 4.0);  // m, so that a large ring is not drawn as a hair
  const Colour colour = bias.in_shadow ? Colour{1.0F, 0.55F, 0.0F, 0.9F} : Colour{0.2F, 0.8F, 0.3F, 0.9F};
  const Eigen::Vector2d centre = bias.predicted_antenna_position;
  Marker ring = make_marker("bias_ring", 0, Marker::LINE_STRIP, colour, time, map_frame);
  ring.scale.x = 0.25 * size;
  for (int i = 0; i <= kSegments; ++i) {
    const double angle = 2.0 * kPi * i / kSegments;
    ring.points.push_back(
        point(centre.x() + bias.radius_m * std::cos(angle), centre.y() + bias.radius_m * std::sin(angle), kHeight_m));
  }
  Marker arrow = make_marker("bias", 0, Marker::ARROW, colour, time, map_frame);
  set_scale(arrow, 0.35 * size, 1.2 * size, 1.8 * size);
  arrow.points = {point(centre.x(), centre.y(), kHeight_m),
                  point(centre.x() + bias.bias.x(), centre.y() + bias.bias.y(), kHeight_m)};
  const Colour fix_colour =
      is_rejected(bias.outcome.decision) ? Colour{0.9F, 0.1F, 0.1F, 1.0F} : Colour{1.0F, 0.95F, 0.1F, 1.0F};
  Marker fix = make_marker("fix", 0, Marker::SPHERE, fix_colour, time, map_frame);
  fix.pose.position = point(bias.fix_position.x(), bias.fix_position.y(), kHeight_m);
  set_scale(fix, size, size, size);
  visualization_msgs::MarkerArray markers;
  markers.markers = {ring, arrow, fix};
  return markers;
}

visualization_msgs::MarkerArray target_markers(const std::vector<Eigen::Vector2d>& targets, std::size_t current,
                                               const ros::Time& time, const std::string& map_frame) {
  visualization_msgs::MarkerArray markers;
  for (std::size_t i = 0; i < targets.size(); ++i) {
    const Colour colour = i == current ? Colour{1.0F, 0.2F, 0.2F, 1.0F} : Colour{0.75F, 0.75F, 0.8F, 0.9F};
    const int id = static_cast<int>(i);
    Marker disc = make_marker("targets", id, Marker::CYLINDER, colour, time, map_frame);
    disc.pose.position = point(targets[i].x(), targets[i].y(), 0.05);
    set_scale(disc, 1.0, 1.0, 0.1);
    Marker label =
        make_marker("target_numbers", id, Marker::TEXT_VIEW_FACING, {1.0F, 1.0F, 1.0F, 1.0F}, time, map_frame);
    label.pose.position = point(1.12 * targets[i].x(), 1.12 * targets[i].y(), 0.6);
    label.scale.z = 1.2;
    label.text = std::to_string(i + 1);
    markers.markers.push_back(disc);
    markers.markers.push_back(label);
  }
  return markers;
}

visualization_msgs::MarkerArray field_markers(double shadow_border_m, double extent_m, const Pose2& truth,
                                              double wheelbase_m, const ros::Time& time, const std::string& map_frame) {
  Marker shadow = make_marker("shadow", 0, Marker::CUBE, {0.35F, 0.3F, 0.5F, 0.45F}, time, map_frame);
  shadow.pose.position = point(0.5 * (shadow_border_m - extent_m), 0.0, -0.06);
  set_scale(shadow, shadow_border_m + extent_m, 2.0 * extent_m, 0.02);
  Marker body = make_marker("truth", 0, Marker::CUBE, {0.95F, 0.95F, 0.95F, 1.0F}, time, map_frame);
  body.pose = to_message(truth);
  const Eigen::Vector2d centre = transform_point(truth, {0.5 * wheelbase_m, 0.0});  // the pose is the rear axle's
  body.pose.position = point(centre.x(), centre.y(), 0.25);
  set_scale(body, 1.4 * wheelbase_m, 0.7 * wheelbase_m, 0.5);
  visualization_msgs::MarkerArray markers;
  markers.markers = {shadow, body};
  return markers;
}

}  // namespace urban_gnss
