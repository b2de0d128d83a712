#pragma once

#include <optional>
#include <string>

#include "urban_gnss_localization/geometry/local_frame.hpp"
#include "urban_gnss_localization/gnss/datum_initializer.hpp"

namespace urban_gnss {

/// The map frame's origin: the parameter's, one that was set, or the median of the first fixes that agree.
class MapDatum {
 public:
  /// Requires parameters without faults.
  explicit MapDatum(const DatumParameters& parameters);

  /// The map frame; nothing until there is a datum.
  const std::optional<LocalFrame>& frame() const { return frame_; }

  /// Takes a fix into account while there is no datum.
  void add(const RawFix& fix);
  /// Sets the datum, which comes from `source`, for people. Returns whether the frame is another one than before.
  /// Throws std::invalid_argument where there is no such place.
  bool set(const GeodeticPosition& datum, const std::string& source = "request");

  /// Where it is and comes from, for people. Requires a datum.
  std::string describe() const;
  /// What is missing, for people; empty where there is a datum.
  std::string waiting_for() const { return initializer_.waiting_for(); }

  /// Forgets fixes. A datum stays: what has been published in the map frame keeps its place.
  void reset();

 private:
  void use(const GeodeticPosition& datum, const std::string& source);

  DatumParameters parameters_;
  DatumInitializer initializer_;
  std::optional<LocalFrame> frame_;
  std::string source_;
};

}  // namespace urban_gnss
