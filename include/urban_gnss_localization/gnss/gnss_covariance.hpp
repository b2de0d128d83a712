#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "urban_gnss_localization/common/parameters.hpp"
#include "urban_gnss_localization/gnss/covariance_filter.hpp"
#include "urban_gnss_localization/gnss/receiver_memory.hpp"
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
  double sigma_ure{3.75};         ///< m, of a range in line of sight
  double blocked_threshold{0.5};  ///< a satellite of which so large a share of rays is blocked is not visible
  bool allow_smaller{false};      ///< than what the receiver claims
  double assumed_hdop{1.2};       ///< where neither the receiver nor satellites tell
  ReceiverWeighting receiver_weighting{ReceiverWeighting::kCn0};
  double weight_cn0{40.0};              ///< dB-Hz, from here on the receiver weighs ranges equally
  double weight_floor{0.01};            ///< least weight of a range, of 1
  double nlos_mean{25.0};               ///< m, of the range error without line of sight
  double nlos_sigma{25.0};              ///< m, about that mean
  double nlos_hidden_exponent{0.0};     ///< both grow with this power of the hidden share of the satellites in view,
  double nlos_elevation_exponent{0.0};  ///< and with this power of the cotangent of the elevation, 1 at 37 degrees
  double nlos_cn0{28.0};                ///< dB-Hz, at which a signal at 37 degrees is as likely reflected as direct
  double nlos_cn0_width{3.0};           ///< dB, that change the odds by e
  double nlos_cn0_rise{-4.5};           ///< dB, by which nlos_cn0 rises from the horizon to the zenith
  double nlos_if_blocked{0.9};          ///< probability of no line of sight where the map blocks it,
  double nlos_if_free{0.005};           ///< where the map shows free space,
  double nlos_if_unknown{0.1};          ///< and where it shows nothing
  ReceiverMemoryParameters memory;
  CovarianceFilterParameters filter;

  template <class V>
  void visit(V& v) {
    v("model", model);
    v("sigma_ure", sigma_ure, positive());
    v("blocked_threshold", blocked_threshold, Range{0.0, 1.0, true});
    v("allow_smaller", allow_smaller);
    v("assumed_hdop", assumed_hdop, positive());
    v("receiver_weighting", receiver_weighting);
    v("weight_cn0", weight_cn0, between(0.0, 70.0));
    v("weight_floor", weight_floor, between(1e-6, 1.0));
    v("nlos_mean", nlos_mean, non_negative());
    v("nlos_sigma", nlos_sigma, positive());
    v("nlos_hidden_exponent", nlos_hidden_exponent, between(0.0, 5.0));
    v("nlos_elevation_exponent", nlos_elevation_exponent, between(0.0, 5.0));
    v("nlos_cn0", nlos_cn0, between(0.0, 70.0));
    v("nlos_cn0_width", nlos_cn0_width, positive());
    v("nlos_cn0_rise", nlos_cn0_rise, between(-30.0, 30.0));
    v("nlos_if_blocked", nlos_if_blocked, between(0.001, 0.999));
    v("nlos_if_free", nlos_if_free, between(0.001, 0.999));
    v("nlos_if_unknown", nlos_if_unknown, between(0.001, 0.999));
    memory.visit(v);
    filter.visit(v);
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
/// The soft model: the second moment of the fix's error by the receiver's own least squares, C = K (diag(v) + m m^T)
/// K^T, where each range has the mean m_i and variance v_i of a mixture of direct and reflected, by its probability p_i
/// of no line of sight from C/N0, elevation and the map. docs/methods/maier.md derives it. It is a continuous function
/// of every blocked fraction and C/N0; with p = 0 and equal weights, C is eq. (4).
///
/// Without a usable satellite, the claim (or that of assumed_hdop) stands for the conventional model, and in the others
/// is multiplied by a factor of the sky's blocked share that is 1 under a free sky.
GnssCovariance gnss_covariance(const std::vector<SatelliteObservation>& satellites,
                               const std::optional<SkyObservation>& sky, const std::optional<Eigen::Matrix2d>& claimed,
                               const GnssCovarianceParameters& parameters);

/// The least covariance that is nowhere below either: matrix - result and floor - result have no positive eigenvalue.
/// Requires both positive definite and finite.
Eigen::Matrix2d at_least(const Eigen::Matrix2d& matrix, const Eigen::Matrix2d& floor);

/// gnss_covariance() fix by fix, with the memory of a receiver: Algorithm 3 in the paper's model, ReceiverMemory in the
/// soft one. There, a fix whose satellites do not determine the position has R_inf alone and leaves no memory: the
/// receiver cannot have had a solution either.
class GnssCovarianceModel {
 public:
  /// Requires parameters without faults.
  explicit GnssCovarianceModel(const GnssCovarianceParameters& parameters)
      : parameters_(parameters), filter_(parameters.filter), memory_(parameters.memory) {}

  GnssCovariance process(Stamp stamp, const std::vector<SatelliteObservation>& satellites,
                         const std::optional<SkyObservation>& sky, const std::optional<Eigen::Matrix2d>& claimed);
  void reset();

 private:
  GnssCovarianceParameters parameters_;
  CovarianceFilter filter_;
  ReceiverMemory memory_;
};

}  // namespace urban_gnss
