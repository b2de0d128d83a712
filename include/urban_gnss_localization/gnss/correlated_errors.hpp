#pragma once

namespace urban_gnss {

/// Factor, 1 to 10^6, on the covariance of a fix `interval_s` after the last one, whose error is a first-order Markov
/// process: (1 + a) / (1 - a), a = exp(-interval / correlation time). With this factor a sequence of such fixes carries
/// as much information as independent ones. 1 where correlation_time_s is not positive.
double markov_inflation(double interval_s, double correlation_time_s);

}  // namespace urban_gnss
