#include "urban_gnss_localization/gnss/chi_squared.hpp"

#include <boost/math/distributions/chi_squared.hpp>
#include <cmath>
#include <sstream>
#include <stdexcept>

namespace urban_gnss {
namespace {

boost::math::chi_squared distribution(int dof) {
  if (dof < 1) throw std::invalid_argument("chi-squared: dof = " + std::to_string(dof) + ": must be at least 1");
  return boost::math::chi_squared(dof);
}

}  // namespace

double chi_squared_quantile(double probability, int dof) {
  const auto chi_squared = distribution(dof);
  if (!(probability >= 0.0 && probability < 1.0)) {
    std::ostringstream message;
    message.precision(17);
    message << "chi-squared: probability = " << probability << ": must be at least 0 and less than 1";
    throw std::invalid_argument(message.str());
  }
  return boost::math::quantile(chi_squared, probability);
}

double chi_squared_cdf(double x, int dof) {
  const auto chi_squared = distribution(dof);
  if (std::isnan(x)) throw std::invalid_argument("chi-squared: x is not a number");
  if (x <= 0.0) return 0.0;
  if (std::isinf(x)) return 1.0;
  return boost::math::cdf(chi_squared, x);
}

}  // namespace urban_gnss
