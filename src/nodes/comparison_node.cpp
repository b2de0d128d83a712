// Errors of several localizers against the truth: ground_truth/odom and NAME/odometry/filtered in, error_plot and their
// ellipses out.
// Parameters: ComparisonNodeParameters (docs/parameters.md).

#include <nav_msgs/Odometry.h>
#include <ros/ros.h>

#include <chrono>
#include <iterator>
#include <sstream>

#include "urban_gnss_localization/evaluation/error_history.hpp"
#include "urban_gnss_localization/ros/comparison_node_parameters.hpp"
#include "urban_gnss_localization/ros/conversions.hpp"
#include "urban_gnss_localization/ros/error_plot.hpp"
#include "urban_gnss_localization/ros/markers.hpp"
#include "urban_gnss_localization/ros/node_parameters.hpp"
#include "urban_gnss_localization/ros/node_shell.hpp"
#include "urban_gnss_localization/ros/topics.hpp"

using namespace urban_gnss;

namespace {

constexpr Stamp kInterval = std::chrono::milliseconds(100);
/// As in rviz/comparison.rviz, in the order of the names.
constexpr Colour kPalette[] = {{0.90F, 0.16F, 0.16F, 1.0F}, {0.95F, 0.60F, 0.0F, 1.0F},  {0.16F, 0.51F, 1.0F, 1.0F},
                               {0.70F, 0.30F, 0.85F, 1.0F}, {0.10F, 0.70F, 0.25F, 1.0F}, {0.0F, 0.70F, 0.75F, 1.0F},
                               {0.85F, 0.40F, 0.60F, 1.0F}, {0.50F, 0.40F, 0.25F, 1.0F}};

std::vector<std::string> words(const std::string& text) {
  std::istringstream stream(text);
  std::vector<std::string> all;
  for (std::string word; stream >> word;) all.push_back(word);
  return all;
}

class ComparisonNode {
 public:
  ComparisonNode(ros::NodeHandle& node, ros::NodeHandle& private_node)
      : parameters_(read_private<ComparisonNodeParameters>(private_node)),
        names_(words(parameters_.localizers)),
        history_(names_.size(), from_seconds(parameters_.window), kInterval) {
    publisher_ = node.advertise<sensor_msgs::Image>(topics::kErrorPlot, 2);
    ellipse_publisher_ = node.advertise<visualization_msgs::Marker>(topics::kEllipses, 100);
    subscribers_.push_back(io_.subscribe<nav_msgs::Odometry>(
        node, topics::kTruth, 1000, [this](const auto& message) { history_.add_truth(to_timed_pose(*message)); }));
    for (std::size_t i = 0; i < names_.size(); ++i) {
      subscribers_.push_back(
          io_.subscribe<nav_msgs::Odometry>(node, names_[i] + "/" + topics::kEstimate, 1000,
                                            [this, i](const auto& message) { take_estimate(i, *message); }));
    }
    five_second_timer_ = io_.every(node, 5.0, "the node's timer", [this] {
      if (!history_.has_truth()) {
        log_.warn("waiting for the truth (" + subscribers_.front().getTopic() + ": " +
                  std::to_string(subscribers_.front().getNumPublishers()) + " publishers)");
      }
    });
    timer_ = io_.every(node, 1.0 / parameters_.plot_rate, "the plot's timer", [this] { publish(); });
  }

 private:
  static Colour colour_of(std::size_t localizer) { return kPalette[localizer % std::size(kPalette)]; }
  static TimedPose to_timed_pose(const nav_msgs::Odometry& message) {
    const PoseEstimate estimate = to_pose_estimate(message.pose);
    return {to_stamp(message.header.stamp), estimate.pose, estimate.covariance};
  }

  void take_estimate(std::size_t localizer, const nav_msgs::Odometry& message) {
    history_.add_estimate(localizer, to_timed_pose(message));
    if (ellipse_publisher_.getNumSubscribers() == 0) return;
    io_.publish(ellipse_publisher_,
                ellipse_marker(to_pose_estimate(message.pose), colour_of(localizer), static_cast<int>(localizer),
                               message.header.stamp, message.header.frame_id));
  }

  void publish() {
    if (!history_.has_truth() || publisher_.getNumSubscribers() == 0) return;
    std::vector<ErrorCurve> curves;
    for (std::size_t i = 0; i < names_.size(); ++i) {
      TrajectoryErrors errors = history_.errors(i);
      if (!errors.samples.empty()) curves.push_back({names_[i], colour_of(i), std::move(errors)});
    }
    sensor_msgs::Image image = error_plot(curves, *history_.latest(), from_seconds(parameters_.window),
                                          parameters_.plot_width, parameters_.plot_height);
    image.header.stamp = to_ros(*history_.latest());
    publisher_.publish(image);
  }

  ComparisonNodeParameters parameters_;
  std::vector<std::string> names_;
  EventLog log_;
  NodeShell io_{log_};
  ErrorHistory history_;
  ros::Publisher publisher_;
  ros::Publisher ellipse_publisher_;
  std::vector<ros::Subscriber> subscribers_;
  ros::WallTimer timer_;
  ros::WallTimer five_second_timer_;
};

}  // namespace

int main(int argc, char** argv) {
  return run_node(argc, argv, "comparison", [](ros::NodeHandle& node, ros::NodeHandle& private_node) {
    return std::make_shared<ComparisonNode>(node, private_node);
  });
}
