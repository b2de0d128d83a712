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
  std::vector<double> datum;
  int datum_fix_count{5};
  double datum_max_spread{15.0};

  void visit(ParameterVisitor& v) {
    v.basic()("datum", datum, "deg, deg, m",
              "latitude, longitude and altitude of the map frame's origin; empty: gps/datum or the first fixes");
    v("datum_fix_count", datum_fix_count, between(1, 1000), "", "number of fixes that must agree on the datum");
    v("datum_max_spread", datum_max_spread, positive(), "m",
      "greatest distance of an agreeing fix from the median of the fixes");
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
