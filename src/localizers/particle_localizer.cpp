#include "urban_gnss_localization/localizers/particle_localizer.hpp"

namespace urban_gnss {

EnumNames<EstimateMethod> enum_names(EstimateMethod) {
  return {{"mean", EstimateMethod::kMean}, {"heaviest_cluster", EstimateMethod::kHeaviestCluster}};
}

}  // namespace urban_gnss
