// The program replay with one localizer more: what a new localizer needs is its own folder, here this file, and one
// line of the registry, here the call of add().

#include "replay.hpp"

namespace urban_gnss {
namespace {

struct DummyParameters {
  double start_sigma{7.0};

  void visit(ParameterVisitor& v) {
    v.basic()("start_sigma", start_sigma, positive(), "m", "standard deviation that it claims for ever");
  }
};

/// Dead-reckons from where it starts.
class Dummy : public Localizer {
 public:
  Dummy(const DummyParameters& parameters, const MotionParameters&) : parameters_(parameters) {}

  const char* name() const override { return "dummy"; }
  std::string mode() const override { return "dead reckoning"; }
  bool wants_bias() const override { return false; }
  void initialize(const PoseEstimate& start) override { pose_ = start.pose; }
  void move(const Twist2& twist, double duration_s) override { pose_ = urban_gnss::move(pose_, twist, duration_s); }
  FixOutcome correct(const FixMeasurement&) override { return {}; }
  Pose2 pose() const override { return pose_; }
  PoseEstimate estimate() const override {
    return {pose_, parameters_.start_sigma * parameters_.start_sigma * Eigen::Matrix3d::Identity()};
  }
  LocalizerHealth health() const override { return {}; }

 private:
  DummyParameters parameters_;
  Pose2 pose_;
};

LocalizerEntry dummy_entry() {
  return make_entry<SettingsWithMotion<Dummy, DummyParameters>>("dummy", "Dead reckoning.", {{"dummy", {}}});
}

}  // namespace
}  // namespace urban_gnss

int main(int argc, char** argv) {
  std::vector<urban_gnss::LocalizerEntry> entries = urban_gnss::standard_localizers().entries();
  entries.push_back(urban_gnss::dummy_entry());
  return urban_gnss::replay_main(argc, argv, urban_gnss::LocalizerRegistry(entries));
}
