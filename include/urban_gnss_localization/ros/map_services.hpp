#pragma once

#include <urban_gnss_localization/FromLL.h>
#include <urban_gnss_localization/FromLLArray.h>
#include <urban_gnss_localization/ToLL.h>
#include <urban_gnss_localization/ToLLArray.h>

#include <optional>

#include "urban_gnss_localization/geometry/local_frame.hpp"

/// The answers of fromLL, toLL, fromLLArray and toLLArray: places to points of the map frame, and back. `map` is
/// nothing while there is no datum; the answer says so. Arrays are converted as a whole or not at all, and the message
/// names the first element that cannot be.
namespace urban_gnss {

using MapFrame = std::optional<LocalFrame>;

urban_gnss_localization::FromLL::Response answer(const urban_gnss_localization::FromLL::Request& request,
                                                 const MapFrame& map);
urban_gnss_localization::ToLL::Response answer(const urban_gnss_localization::ToLL::Request& request,
                                               const MapFrame& map);
urban_gnss_localization::FromLLArray::Response answer(const urban_gnss_localization::FromLLArray::Request& request,
                                                      const MapFrame& map);
urban_gnss_localization::ToLLArray::Response answer(const urban_gnss_localization::ToLLArray::Request& request,
                                                    const MapFrame& map);

}  // namespace urban_gnss
