#pragma once

#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "urban_gnss_localization/common/parameters.hpp"
#include "urban_gnss_localization/gnss/fix.hpp"

namespace urban_gnss {

/// Where the map frame's origin comes from.
struct DatumParameters {
  /// latitude in deg, longitude in deg, altitude above the ellipsoid in m; empty: from the first fixes that agree
  std::vector<double> datum;
  /// count of fixes that must agree
  int datum_fix_count{5};
  /// m, farthest that one of these fixes may lie from their median
  double datum_max_spread{15.0};

  template <class V>
  void visit(V& v) {
    v("datum", datum);
    v("datum_fix_count", datum_fix_count, between(1, 1000));
    v("datum_max_spread", datum_max_spread, positive());
  }
  void check(std::vector<std::string>& faults) const;
};

/// Finds the datum: the parameter's, or else the median of the last fixes once they agree, so that neither a single
/// fix nor one outlier among them fixes the map frame for good.
class DatumInitializer {
 public:
  /// Requires parameters without faults.
  explicit DatumInitializer(DatumParameters parameters);

  /// The datum that the parameter gives, if it gives one.
  std::optional<GeodeticPosition> fixed() const;

  /// Takes a fix into account and returns the datum as soon as there is one: fixed(), or the median east, north and
  /// altitude of the last `datum_fix_count` usable fixes with different stamps, all horizontally within
  /// `datum_max_spread` of it. Its altitude is 0 where no fix has one. A fix that is_usable_position() refuses is
  /// ignored.
  std::optional<GeodeticPosition> add(const RawFix& raw);

  /// Forgets every fix; a datum that the parameter gives remains.
  void reset();

  /// What is missing for people, e.g. "3 of 5 agreeing fixes"; empty where there is a datum.
  std::string waiting_for() const;

 private:
  struct Agreement {
    GeodeticPosition median;
    std::size_t count{0};  ///< fixes near the median
  };
  Agreement agreement() const;
  bool is_complete(const Agreement& agreement) const;

  DatumParameters parameters_;
  std::deque<RawFix> window_;
};

}  // namespace urban_gnss
