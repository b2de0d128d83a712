#include "urban_gnss_localization/localizers/localizer_entry.hpp"
#include "urban_gnss_localization/localizers/maier/ukf.hpp"

namespace urban_gnss {

LocalizerEntry ukf_entry() {
  return make_entry<SettingsWithMotion<Ukf, UkfParameters>>(
      "ukf", "Maier and Kleiner: an unscented Kalman filter, behind occlusion_node or on its own.",
      {{"ukf", {}, true}, {"ukf_as_printed", {"mode=as_printed"}, false, true}});
}

}  // namespace urban_gnss
