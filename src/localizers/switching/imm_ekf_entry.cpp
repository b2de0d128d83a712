#include "urban_gnss_localization/localizers/localizer_entry.hpp"
#include "urban_gnss_localization/localizers/switching/imm_ekf.hpp"

namespace urban_gnss {

LocalizerEntry imm_ekf_entry() {
  return make_entry<SettingsWithMotion<ImmEkf, ImmEkfParameters>>(
      "imm_ekf",
      "Our own: interacting multiple models of a bias that comes and goes; the odometry's errors are states.",
      {{"imm_ekf", {}, true}}, "switching_model");
}

}  // namespace urban_gnss
