#pragma once

#include <Eigen/Dense>

namespace urban_gnss {

/// Friedland's two-stage estimator ("Treatment of bias in recursive filtering", 1969) in the steps of Kim et al. 3.2 A
/// and B: a bias-free Kalman filter, a bias filter that is driven by its innovation, and the blending matrix V that
/// joins them. For the linear system
///   x(k) = F x(k-1) + B b + w,  z(k) = H x(k) + C b + v,  cov(w) = Q, cov(v) = R,
/// it gives what a Kalman filter of the augmented state (x, b) gives (to rounding; a test compares them).
///
/// Against the paper's text: 3.2 A.2 and A.3 use the Jacobians where the nonlinear f and h are meant, so that the
/// predicted state and the innovation come from the caller; P is updated in Joseph form; b may walk randomly.
///
/// While the bias covariance is zero this is the bias-free filter alone: open_bias() starts the second stage,
/// close_bias() ends it. Sizes may be Eigen::Dynamic; units and frames are the caller's.
template <int StateSize, int BiasSize, int MeasurementSize>
class TwoStageFilter {
 public:
  using State = Eigen::Matrix<double, StateSize, 1>;
  using StateCovariance = Eigen::Matrix<double, StateSize, StateSize>;
  using Bias = Eigen::Matrix<double, BiasSize, 1>;
  using BiasCovariance = Eigen::Matrix<double, BiasSize, BiasSize>;
  using Blending = Eigen::Matrix<double, StateSize, BiasSize>;
  using Measurement = Eigen::Matrix<double, MeasurementSize, 1>;
  using MeasurementCovariance = Eigen::Matrix<double, MeasurementSize, MeasurementSize>;
  using Observation = Eigen::Matrix<double, MeasurementSize, StateSize>;
  using BiasObservation = Eigen::Matrix<double, MeasurementSize, BiasSize>;

  /// Starts without a bias stage. `bias_size` matters where BiasSize is Dynamic.
  TwoStageFilter(const State& state, const StateCovariance& covariance, Eigen::Index bias_size = BiasSize)
      : x_(state),
        p_(covariance),
        b_(Bias::Zero(bias_size)),
        m_(BiasCovariance::Zero(bias_size, bias_size)),
        v_(Blending::Zero(state.size(), bias_size)) {}

  /// A.1, A.2 and B.1: P- = F P F' + Q, U = F V + B. `predicted` is f of the bias-free state. Between corrections U
  /// stands where V stood, so that several predictions may follow each other.
  void predict(const State& predicted, const StateCovariance& f, const StateCovariance& q, const Blending& b) {
    x_ = predicted;
    p_ = f * p_ * f.transpose() + q;
    v_ = f * v_ + b;
  }

  /// The same for a bias that does not enter the motion (B = 0).
  void predict(const State& predicted, const StateCovariance& f, const StateCovariance& q) {
    x_ = predicted;
    p_ = f * p_ * f.transpose() + q;
    v_ = (f * v_).eval();
  }

  /// The random walk of the bias, M <- M + Q_b (the paper's bias is constant, its M goes to 0). x and P are rewritten
  /// so that the compensated estimate, its covariance and its covariance with the bias stay what they were (Hsieh and
  /// Chen, "Optimal solution of the two-stage Kalman estimator", 1999): with Friedland's V alone they would change.
  /// Requires M + Q_b positive definite.
  void grow_bias(const BiasCovariance& q_b) {
    const BiasCovariance grown = m_ + q_b;
    const Blending kept = grown.ldlt().solve(m_ * v_.transpose()).transpose();  // V M (M + Q_b)^-1
    x_ += (v_ - kept) * b_;
    p_ += v_ * m_ * (v_ - kept).transpose();
    symmetrise(p_);
    v_ = kept;
    m_ = grown;
  }

  /// The bias fades, b <- share b (0 < share <= 1), while the compensated estimate stays what it was.
  void fade_bias(double share) {
    b_ *= share;
    m_ *= share * share;
    v_ /= share;
  }

  /// Covariance of the innovation, the bias's uncertainty included: H P H' + R + T M T' with T = H U + C (B.2).
  MeasurementCovariance innovation_covariance(const Observation& h, const BiasObservation& c,
                                              const MeasurementCovariance& r) const {
    const BiasObservation t = h * v_ + c;
    return h * p_ * h.transpose() + r + t * m_ * t.transpose();
  }

  /// A.4 to A.8 and B.2 to B.6 with the bias-free innovation: z - h(bias-free state). The innovation that is tested for
  /// consistency is compensated_innovation().
  void correct(const Measurement& innovation, const Observation& h, const BiasObservation& c,
               const MeasurementCovariance& r) {
    const StateCovariance identity = StateCovariance::Identity(x_.size(), x_.size());
    const BiasCovariance bias_identity = BiasCovariance::Identity(b_.size(), b_.size());
    const MeasurementCovariance s = h * p_ * h.transpose() + r;
    const Eigen::Matrix<double, StateSize, MeasurementSize> k_x = s.ldlt().solve(h * p_).transpose();
    const BiasObservation t = h * v_ + c;
    // M (V' H' + C') R^-1 of step B.5 with the updated M and V, in the form that needs no inverse of R.
    const MeasurementCovariance s_b = s + t * m_ * t.transpose();
    const Eigen::Matrix<double, BiasSize, MeasurementSize> k_b = s_b.ldlt().solve(t * m_).transpose();

    const StateCovariance left = identity - k_x * h;
    p_ = left * p_ * left.transpose() + k_x * r * k_x.transpose();
    symmetrise(p_);
    x_ += k_x * innovation;
    v_ -= k_x * t;
    const BiasCovariance bias_left = bias_identity - k_b * t;
    m_ = bias_left * m_ * bias_left.transpose() + k_b * s * k_b.transpose();
    symmetrise(m_);
    b_ = bias_left * b_ + k_b * innovation;
  }

  /// The innovation of the compensated estimate, given the bias-free one: z - h(x) - T b.
  Measurement compensated_innovation(const Measurement& innovation, const Observation& h,
                                     const BiasObservation& c) const {
    return innovation - (h * v_ + c) * b_;
  }

  /// Starts the second stage anew: b = 0, cov(b) = M0, independent of the state.
  void open_bias(const BiasCovariance& m0) {
    close_bias();
    m_ = m0;
  }

  /// Ends the second stage: the compensated estimate, with its covariance, becomes the bias-free one.
  void close_bias() {
    const State state = compensated_state();
    const StateCovariance covariance = compensated_covariance();
    set_state(state, covariance);
  }

  /// Ends the second stage knowing that there was no bias: what is left is the bias-free estimate, which has taken
  /// every measurement since open_bias() as unbiased. For a constant bias this is the joint estimate given b = 0.
  void discard_bias() {
    b_.setZero();
    m_.setZero();
    v_.setZero();
  }

  /// Replaces the estimate and forgets the bias.
  void set_state(const State& state, const StateCovariance& covariance) {
    x_ = state;
    p_ = covariance;
    discard_bias();
  }

  /// Moves the origin of the state: what is x becomes x - offset. For filters that estimate an error and feed it back.
  void shift_origin(const State& offset) { x_ -= offset; }

  const State& bias_free_state() const { return x_; }
  const StateCovariance& bias_free_covariance() const { return p_; }
  const Bias& bias() const { return b_; }
  const BiasCovariance& bias_covariance() const { return m_; }
  const Blending& blending() const { return v_; }

  /// B.7 and B.8: x + V b, with the covariance P + V M V' and the covariance V M with the bias.
  State compensated_state() const { return x_ + v_ * b_; }
  StateCovariance compensated_covariance() const {
    StateCovariance covariance = p_ + v_ * m_ * v_.transpose();
    symmetrise(covariance);
    return covariance;
  }
  Blending cross_covariance() const { return v_ * m_; }

 private:
  template <class Matrix>
  static void symmetrise(Matrix& matrix) {
    matrix = (0.5 * (matrix + matrix.transpose())).eval();
  }

  State x_;            ///< bias-free
  StateCovariance p_;  ///< bias-free
  Bias b_;
  BiasCovariance m_;
  Blending v_;  ///< U between prediction and correction
};

}  // namespace urban_gnss
