#pragma once

#include <tf2/buffer_core.h>

#include <string>

#include "urban_gnss_localization/pipeline/frame_source.hpp"

namespace urban_gnss {

/// The transforms of a tf buffer.
class TfFrames : public FrameSource {
 public:
  /// The buffer must outlive it.
  explicit TfFrames(tf2::BufferCore& buffer) : buffer_(buffer) {}

  std::optional<Eigen::Isometry3d> find(const std::string& parent, const std::string& child, Stamp stamp) override;
  std::optional<Transform> newest(const std::string& parent, const std::string& child) override;
  void forget() override { buffer_.clear(); }
  const std::string& fault() const override { return fault_; }

 private:
  std::optional<Transform> look_up(const std::string& parent, const std::string& child, const ros::Time& time);

  tf2::BufferCore& buffer_;
  std::string fault_;
};

}  // namespace urban_gnss
