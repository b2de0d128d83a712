"""Whether declared variances follow the satellites' geometry as variances do, or as standard deviations.

A variance is the ranges' times the squared dilution of precision (DOP), which the satellites' directions tell. In
logarithms it follows it with the exponent 1, and sigma in place of sigma^2 with 1/2: over time, and east against north.
"""

import numpy as np

from .finding import warned

SAME_S = 0.02
LEAST = 100                    # fixes with satellites
LEAST_CHANGE = 0.2             # standard deviation of the logarithm of the squared DOP
# Good recordings have exponents of 1.0 to 1.7 over time, 0.9 to 1.15 east against north, where they are related so
# well.
RELATED_TIME, RELATED_AXES = 0.9, 0.6
SIGMA_TIME, SIGMA_AXES = (0.35, 0.65), (0.3, 0.68)
ROUND = 1e-6


def check(evidence):
    """The finding, if there is one."""
    pairs = paired(evidence.recording.fix, evidence.recording.satellites)
    if pairs is None:
        return []
    cov_xx, cov_yy, dop_xx, dop_yy = pairs
    axes = np.log(cov_xx / cov_yy), np.log(dop_xx / dop_yy)
    if np.mean(np.abs(axes[0]) < ROUND) < 0.5:
        found, limits = exponent(axes[1], axes[0], RELATED_AXES), SIGMA_AXES
    else:
        found = exponent(np.log(dop_xx + dop_yy), np.log(cov_xx + cov_yy), RELATED_TIME, centred=True)
        limits = SIGMA_TIME
    if found is None or not limits[0] < found < limits[1]:
        return []
    return [warned("covariance.sigma", "{}: the variances follow the satellites' geometry as standard deviations do "
                   "(with the exponent {:.2f} of the squared DOP, in place of 1): sigma in place of sigma^2".format(
                       evidence.recording.fix.topic, found),
                   "in the driver: position_covariance is in m^2", "localization.launch receiver:=gpsd  # if it is "
                   "gpsd_client: takes GPSFix", exponent=found)]


def paired(fix, satellites):
    """Variances of fixes and squared DOPs of their satellites, where both are known; None where they are few."""
    if fix is None or satellites is None or len(fix) < LEAST or len(satellites) < LEAST:
        return None
    order = np.argsort(satellites.t)
    stamps = satellites.t[order]
    place = np.clip(np.searchsorted(stamps, fix.t - SAME_S), 0, len(stamps) - 1)
    match = order[place]
    with np.errstate(invalid="ignore"):
        good = (np.abs(satellites.t[match] - fix.t) <= SAME_S) & (fix.cov_type > 0) & (fix.status >= 0)
        good &= (fix.cov_xx > 0.0) & (fix.cov_yy > 0.0)
        good &= (satellites.dop_xx[match] > 0.0) & (satellites.dop_yy[match] > 0.0)
        good &= (fix.cov_xx < 1e12) & (fix.cov_yy < 1e12)
    if np.sum(good) < LEAST:
        return None
    match = match[good]
    return fix.cov_xx[good], fix.cov_yy[good], satellites.dop_xx[match], satellites.dop_yy[match]


def exponent(x, y, related, centred=False):
    """Slope of y over x; None where x hardly changes or they are not related."""
    if np.std(x) < LEAST_CHANGE or np.std(y) < 1e-9:
        return None
    if np.corrcoef(x, y)[0, 1] < related:
        return None
    if centred:
        x, y = x - np.mean(x), y - np.mean(y)
    return float(np.sum(x * y) / np.sum(x * x))
