#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "urban_gnss_localization/common/parameters.hpp"
#include "urban_gnss_localization/gnss/covariance_filter.hpp"
#include "urban_gnss_localization/gnss/nlos_model.hpp"
#include "urban_gnss_localization/gnss/receiver_smoothing.hpp"
#include "urban_gnss_localization/gnss/satellite.hpp"

namespace urban_gnss {

/// What the covariance of a fix is computed from.
enum class CovarianceModel {
  kConventional,  ///< Maier and Kleiner 2010, eq. (4): all tracked satellites
  kPaper,         ///< eq. (6): the visible ones only, then Algorithm 3
  kSoft,          ///< ranges without line of sight, by their probability, through the receiver's least squares
};
EnumNames<CovarianceModel> enum_names(CovarianceModel);

/// How the receiver is taken to weigh its ranges.
enum class ReceiverWeighting { kEqual, kCn0 };
EnumNames<ReceiverWeighting> enum_names(ReceiverWeighting);

/// What there was to tell signals with a line of sight from those without.
enum class VisibilitySource : std::uint8_t {
  kNone = 0,                ///< neither a map nor C/N0: the conventional model
  kSatellites = 1,          ///< C/N0 and elevation
  kLidar = 2,               ///< the map: of each satellite, or of the sky where no satellites are reported
  kLidarAndSatellites = 3,  ///< the map and C/N0
};
const char* to_string(VisibilitySource source);

struct GnssCovarianceParameters {
  CovarianceModel model{CovarianceModel::kSoft};
  double sigma_ure{3.75};
  double blocked_threshold{0.5};
  bool allow_smaller{false};
  double assumed_hdop{1.2};
  ReceiverWeighting receiver_weighting{ReceiverWeighting::kCn0};
  double weight_cn0{40.0};
  double weight_floor{0.01};
  NlosParameters nlos{25.0, 25.0, NlosElevationLaw::kCotangent, 0.0, 3.0, -4.5};
  double nlos_hidden_exponent{0.0};
  double nlos_cn0{28.0};
  double nlos_if_blocked{0.9};
  double nlos_if_free{0.005};
  double nlos_if_unknown{0.1};
  ReceiverSmoothingParameters smoothing;
  CovarianceFilterParameters filter;

  void visit(ParameterVisitor& v) {
    v.basic()("model", model,
              "covariance model; soft: by NLOS probabilities; paper: eq. (6) and Algorithm 3; conventional: eq. (4)");
    v.basic()("sigma_ure", sigma_ure, positive(), "m", "standard deviation of a range in line of sight");
    v("blocked_threshold", blocked_threshold, open_between(0.0, 1.0), "",
      "share of blocked rays at which a satellite counts as not visible (paper)");
    v("allow_smaller", allow_smaller, "whether the result may be smaller than the receiver's own covariance");
    v("assumed_hdop", assumed_hdop, positive(), "", "HDOP assumed where neither receiver nor satellites provide one");
    v("receiver_weighting", receiver_weighting,
      "weighting of the ranges assumed of the receiver: equal, or by C/N0 (soft)");
    v("weight_cn0", weight_cn0, between(0.0, 70.0), "dB-Hz",
      "C/N0 above which the receiver is assumed to weight ranges equally");
    v("weight_floor", weight_floor, between(1e-6, 1.0), "",
      "least relative weight that the receiver is assumed to give to a range");
    v.group("nlos", nlos, "Excess range of an NLOS signal.");
    v("nlos_hidden_exponent", nlos_hidden_exponent, between(0.0, 5.0), "",
      "exponent of the hidden share of the satellites in view in the factor on excess ranges; 0: no effect");
    v("nlos_cn0", nlos_cn0, between(0.0, 70.0), "dB-Hz",
      "C/N0 at which a signal at 37 degrees elevation is as likely NLOS as in line of sight");
    v("nlos_if_blocked", nlos_if_blocked, between(0.001, 0.999), "",
      "probability of no line of sight where the map shows an obstruction");
    v("nlos_if_free", nlos_if_free, between(0.001, 0.999), "",
      "probability of no line of sight where the map shows free space");
    v("nlos_if_unknown", nlos_if_unknown, between(0.001, 0.999), "",
      "probability of no line of sight where the map shows nothing");
    v.group("smoothing", smoothing, "Smoothing of solutions by the receiver.");
    v.group("filter", filter, "Filter of the covariance, Algorithm 3 (paper).");
  }
  void check(std::vector<std::string>& faults) const;
};

/// What the map blocks of the sky as a whole, for a receiver that reports no satellites.
struct SkyObservation {
  double blocked_fraction{0.0};
  double known_fraction{0.0};
};

/// What came of one satellite, in the order of the observations.
struct SatelliteAssessment {
  bool is_used{false};  ///< tracked, with usable angles, and not seen before in the same list
  bool is_visible{false};
  double nlos_probability{0.0};
};

struct GnssCovariance {
  VisibilitySource source{VisibilitySource::kNone};
  int satellite_count{0};  ///< used
  int visible_count{0};    ///< of these: by the map (conventional, paper) or probably (soft)
  double hdop_all{std::numeric_limits<double>::quiet_NaN()};      ///< NaN where the geometry does not determine it
  double hdop_visible{std::numeric_limits<double>::quiet_NaN()};  ///< likewise
  Eigen::Matrix2d conventional{Eigen::Matrix2d::Identity()};      ///< eq. (4), m^2, east and north; for comparison
  Eigen::Matrix2d model{Eigen::Matrix2d::Identity()};             ///< of the model that was chosen, without memory
  Eigen::Vector2d bias{Eigen::Vector2d::Zero()};                  ///< soft: mean error by reflections, m; within model
  Eigen::Matrix2d weighted{Eigen::Matrix2d::Identity()};          ///< to be used: not below the receiver's claim
  bool is_good{true};         ///< classification by sigma_threshold and, in the paper's model, recovery
  bool is_recovering{false};  ///< bad because of the fixes before
  std::vector<SatelliteAssessment> satellites;
};

/// Covariance of one fix without memory of those before it (weighted, is_good and is_recovering are those of `model`
/// alone). `claimed` is the receiver's own covariance, where it has one. Never
/// throws; every covariance is finite and positive definite for every input. R_inf, which is sigma_infinite^2 I,
/// stands where the satellites do not determine the position: in the paper's model the visible ones (fewer than 3 and
/// their constellations, or a singular geometry), else the used ones.
///
/// One clock is estimated for each constellation; SBAS and QZSS share that of GPS, whose time they keep.
///
/// The soft model takes each signal as NLOS with a probability, by map and C/N0, and carries mean and variance of its
/// range error (nlos_range()) through the receiver's least squares: docs/methods/maier.md derives it.
GnssCovariance gnss_covariance(const std::vector<SatelliteObservation>& satellites,
                               const std::optional<SkyObservation>& sky, const std::optional<Eigen::Matrix2d>& claimed,
                               const GnssCovarianceParameters& parameters);

/// The least covariance that is nowhere below either: matrix - result and floor - result have no positive eigenvalue.
/// Requires both positive definite and finite.
Eigen::Matrix2d covariance_upper_bound(const Eigen::Matrix2d& matrix, const Eigen::Matrix2d& floor);

/// gnss_covariance() fix by fix, as a receiver smooths them: Algorithm 3 in the paper's model, ReceiverSmoothing in
/// the soft one. There, a fix whose satellites do not determine the position has R_inf alone and is not smoothed: the
/// receiver cannot have had a solution either.
class GnssCovarianceModel {
 public:
  /// Requires parameters without faults.
  explicit GnssCovarianceModel(const GnssCovarianceParameters& parameters)
      : parameters_(parameters), filter_(parameters.filter), smoothing_(parameters.smoothing) {}

  GnssCovariance process(Stamp stamp, const std::vector<SatelliteObservation>& satellites,
                         const std::optional<SkyObservation>& sky, const std::optional<Eigen::Matrix2d>& claimed);
  void reset();

 private:
  GnssCovarianceParameters parameters_;
  CovarianceFilter filter_;
  ReceiverSmoothing smoothing_;
};

}  // namespace urban_gnss
