#pragma once

namespace urban_gnss {

/// Degrees of freedom of a horizontal fix's normalised innovation squared.
inline constexpr int kFixDof = 2;

/// The value that a chi-squared variable with `dof` degrees of freedom does not exceed with `probability`: the gate's
/// threshold for a normalised innovation squared of that dimension. Throws std::invalid_argument unless
/// 0 <= probability < 1 and dof >= 1.
double chi_squared_quantile(double probability, int dof);

/// The probability that a chi-squared variable with `dof` degrees of freedom does not exceed `x`: 0 for x <= 0, 1 for
/// infinity. Throws std::invalid_argument where x is NaN or dof < 1.
double chi_squared_cdf(double x, int dof);

}  // namespace urban_gnss
