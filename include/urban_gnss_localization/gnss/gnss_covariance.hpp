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
    v.basic()("model", model, "soft, paper: eq. (6) and Algorithm 3, or conventional: eq. (4)");
    v.basic()("sigma_ure", sigma_ure, positive(), "m", "standard deviation of a range in line of sight");
    v("blocked_threshold", blocked_threshold, open_between(0.0, 1.0), "",
      "paper: a satellite with so large a share of blocked rays is not visible");
    v("allow_smaller", allow_smaller, "whether the result may be below the receiver's own covariance");
    v("assumed_hdop", assumed_hdop, positive(), "", "where neither the receiver nor satellites tell");
    v("receiver_weighting", receiver_weighting, "soft: how the receiver is taken to weigh its ranges, equal or cn0");
    v("weight_cn0", weight_cn0, between(0.0, 70.0), "dB-Hz", "from here on it weighs ranges equally");
    v("weight_floor", weight_floor, between(1e-6, 1.0), "", "its least weight of a range, of 1");
    v.group("nlos", nlos, "The excess range of an NLOS signal.");
    v("nlos_hidden_exponent", nlos_hidden_exponent, between(0.0, 5.0), "",
      "excess ranges grow with this power of the hidden share of the satellites in view");
    v("nlos_cn0", nlos_cn0, between(0.0, 70.0), "dB-Hz",
      "at which a signal at 37 degrees elevation is as likely NLOS as not");
    v("nlos_if_blocked", nlos_if_blocked, between(0.001, 0.999), "",
      "probability of no line of sight where the map blocks it");
    v("nlos_if_free", nlos_if_free, between(0.001, 0.999), "", "where the map shows free space");
    v("nlos_if_unknown", nlos_if_unknown, between(0.001, 0.999), "", "where the map shows nothing");
    v.group("smoothing", smoothing, "How the receiver smooths its solutions.");
    v.group("filter", filter, "paper: the filter of the covariance, Algorithm 3.");
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
/// The soft model. The receiver's fix is x = K z with K = (H^T W H)^-1 H^T W and *its* weights W, equal or by C/N0 (the
/// variance of a range is proportional to 10^(-C/N0 / 10); Hartinger and Brunner 1999). It does not know which signals
/// are reflected. A range that is reflected with probability p_i has an error with
///   mean m_i = p_i mu_i,   variance v_i = (1 - p_i) sigma_URE^2 + p_i sigma_i^2 + p_i (1 - p_i) mu_i^2,
/// independent of the others, given the p_i. The second moment of the fix's error is thus
///   C = K (diag(v) + m m^T) K^T.
/// mu_i = s_i nlos_mean and sigma_i = max(s_i nlos_sigma, sigma_URE). A signal that comes over the roofs goes on
/// between the walls for a way that is proportional to cot e, and the more of the sky is hidden, the more walls turn it
/// on:
///   s_i = h^nlos_hidden_exponent (cot e_i / cot 37 deg)^nlos_elevation_exponent,
/// h the expected share without line of sight of the satellites in view (those of the list above the horizon; one that
/// is not received has none), e_i not below 15 degrees, whence the way is limited by the walls' length. With exponents
/// of 0, all reflections are alike.
/// A delay that all ranges of a constellation share goes into its clock, not into C. With p = 0 and equal weights, C is
/// eq. (4). It is a continuous function of every blocked fraction and C/N0.
///
/// p_i: from C/N0 c and elevation e, the log-odds are L = (nlos_cn0 + nlos_cn0_rise (sin e - 0.6) - c) /
/// nlos_cn0_width, where nothing else is known. The rise is positive where the antenna receives best from above, and
/// negative where that counts for less than that what stands low is hidden more often. The map alone says q =
/// nlos_if_blocked, nlos_if_free and nlos_if_unknown, each times the share of its rays. Both together, as independent
/// evidence: L + logit(q) - logit(nlos_if_unknown).
///
/// Without a usable satellite, the claim (or that of assumed_hdop) stands for the conventional model, and in the others
/// is multiplied by 1 + (v(q) - v(nlos_if_free)) / sigma_URE^2 for the sky's q: what a sky evenly full of satellites
/// gives, and 1 under a free one.
GnssCovariance gnss_covariance(const std::vector<SatelliteObservation>& satellites,
                               const std::optional<SkyObservation>& sky, const std::optional<Eigen::Matrix2d>& claimed,
                               const GnssCovarianceParameters& parameters);

/// The least covariance that is nowhere below either: matrix - result and floor - result have no positive eigenvalue.
/// Requires both positive definite and finite.
Eigen::Matrix2d covariance_upper_bound(const Eigen::Matrix2d& matrix, const Eigen::Matrix2d& floor);

/// gnss_covariance() fix by fix, with the memory of a receiver: Algorithm 3 in the paper's model, ReceiverSmoothing in
/// the soft one. There, a fix whose satellites do not determine the position has R_inf alone and leaves no memory: the
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
