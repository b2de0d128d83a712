#include "output_bag.hpp"

namespace urban_gnss {
OutputBag::OutputBag(const std::filesystem::path& path, const InputFiles& inputs) : pending_(prepared(path, inputs)) {
  guarded([&] { bag_->open(pending_.path().string(), rosbag::bagmode::Write); });
}

OutputBag::~OutputBag() {
  if (!bag_) return;
  try {
    bag_->close();
  } catch (const rosbag::BagException&) {
    // Its destructor would close it once more, and an exception there ends the program without a word.
    static_cast<void>(bag_.release());
  }
}

void OutputBag::close() {
  guarded([&] { bag_->close(); });
  bag_.reset();
  pending_.commit();
}

}  // namespace urban_gnss
