#include "urban_gnss_localization/localizers/kim/complementary_ekf.hpp"
#include "urban_gnss_localization/localizers/localizer_entry.hpp"

namespace urban_gnss {
namespace {

class ComplementaryEkfSettings : public LocalizerSettings {
 public:
  using Made = ComplementaryEkf;

  void visit(ParameterVisitor& v) override { v.include(filter_); }
  std::unique_ptr<Localizer> make() const override { return std::make_unique<ComplementaryEkf>(filter_); }

 private:
  ComplementaryEkfParameters filter_;
};

}  // namespace

LocalizerEntry complementary_ekf_entry() {
  return make_entry<ComplementaryEkfSettings>(
      "complementary_ekf",
      "Kim et al.: a complementary EKF whose bias filter opens where the fixes contradict the odometry.",
      {{"ekf", {"mode=standard"}},
       {"gated_ekf", {"mode=gated"}},
       {"complementary_ekf", {"mode=compensated"}},
       {"ekf_as_printed", {"mode=standard_as_printed"}, false, true},
       {"gated_ekf_as_printed", {"mode=gated_as_printed"}, false, true},
       {"complementary_ekf_as_printed", {"mode=compensated_as_printed"}, false, true}});
}

}  // namespace urban_gnss
