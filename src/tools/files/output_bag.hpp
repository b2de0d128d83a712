#pragma once

#include <rosbag/bag.h>

#include <filesystem>
#include <memory>
#include <string>

#include "input_files.hpp"
#include "urban_gnss_localization/common/pending_file.hpp"

namespace urban_gnss {

/// A bag that is written: it appears whole, by close(), or not at all.
class OutputBag {
 public:
  /// Throws std::runtime_error that names the file where it is one of `inputs` or cannot be written.
  OutputBag(const std::filesystem::path& path, const InputFiles& inputs);
  ~OutputBag();

  /// Throws std::runtime_error that names the file where the disk does not take it.
  template <class Message>
  void write(const std::string& topic, const ros::Time& time, const Message& message) {
    guarded([&] { bag_->write(topic, time, message); });
  }
  void close();

 private:
  template <class Action>
  void guarded(const Action& action) {
    try {
      action();
    } catch (const rosbag::BagException& error) {
      throw pending_.failure(error.what());
    }
  }

  PendingFile pending_;
  std::unique_ptr<rosbag::Bag> bag_{std::make_unique<rosbag::Bag>()};
};

}  // namespace urban_gnss
