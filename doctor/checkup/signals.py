"""Series in time: making them regular, correlating them, robust statistics."""

from collections import namedtuple

import numpy as np

LONGEST_SERIES = 2000000
AS_GOOD, NEARLY_AS_GOOD = 0.97, 0.9  # of the greatest correlation
NEAR_S = 5.0           # the flank of a peak
SCALE_OF_MAD = 1.4826  # median absolute deviation to the standard deviation of a normal distribution

# `lag` s: by how much the stamps of the second series are ahead of the first's (positive: its events have later
# stamps); `correlation` at this lag, of the sign of the strongest; `at_zero` the correlation without a lag; `support`
# samples. `unique`: whether no other lag is nearly as good.
Lag = namedtuple("Lag", "lag correlation at_zero support unique")


def finite(values):
    """Only what is finite."""
    values = np.asarray(values, dtype=float)
    return values[np.isfinite(values)]


def median(values):
    """The median of what is finite; NaN of nothing."""
    values = finite(values)
    return float(np.median(values)) if len(values) else float("nan")


def robust_sigma(values):
    """Standard deviation by the median absolute deviation; NaN of nothing."""
    return SCALE_OF_MAD * median(np.abs(finite(values) - median(values))) if len(finite(values)) else float("nan")


def wrap(angle):
    """The angle in [-pi, pi)."""
    return (np.asarray(angle) + np.pi) % (2.0 * np.pi) - np.pi


def in_order(t, *columns):
    """The columns with finite values, sorted by time, each time once."""
    good = np.isfinite(t)
    for column in columns:
        good &= np.isfinite(column)
    t = np.asarray(t)[good]
    _, first = np.unique(t, return_index=True)
    return (t[first],) + tuple(np.asarray(column)[good][first] for column in columns)


def period(t):
    """Median time between messages; NaN where there are fewer than two."""
    return median(np.diff(t)) if len(t) > 1 else float("nan")


def gaps_mask(t, at, longest):
    """Whether each time of `at` lies between two of `t` that are at most `longest` apart."""
    after = np.clip(np.searchsorted(t, at), 1, len(t) - 1)
    return (at >= t[0]) & (at <= t[-1]) & (t[after] - t[after - 1] <= longest)


def resample(t, values, grid, step):
    """Means over `step` about the times of the grid, and where they are valid. Needs two samples."""
    # The integral, interpolated: its differences are the means, however the samples lie.
    integral = np.concatenate([[0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(t))])
    low, high = np.interp(grid - 0.5 * step, t, integral), np.interp(grid + 0.5 * step, t, integral)
    inside = (grid - 0.5 * step >= t[0]) & (grid + 0.5 * step <= t[-1])
    valid = inside & gaps_mask(t, grid, max(3.0 * period(t), 1.5 * step))
    return (high - low) / step, valid


def common_grid(first_t, second_t, finest=0.05, coarsest=1.0, reach=0.0):
    """A regular grid where both are, and `reach` around, and its step: as coarse as the slower one."""
    step = float(np.clip(max(period(first_t), period(second_t)), finest, coarsest))
    begin, end = max(first_t[0], second_t[0]) - reach, min(first_t[-1], second_t[-1]) + reach
    return np.arange(begin, end, step) if end > begin else np.empty(0), step


def correlate(first, first_valid, second, second_valid, reach):
    """Normalized correlation of two regular series for shifts of the second of -reach to reach samples.

    Each shift is judged by the samples that both have then. Returns the correlations and the counts of samples.
    """
    size = 1 << int(np.ceil(np.log2(len(first) + len(second) + 1)))
    transform = lambda values: np.fft.rfft(values, size)  # noqa: E731
    masks = first_valid.astype(float), second_valid.astype(float)
    # Centred first, for digits.
    a = np.where(first_valid, first - np.mean(first[first_valid]) if first_valid.any() else 0.0, 0.0)
    b = np.where(second_valid, second - np.mean(second[second_valid]) if second_valid.any() else 0.0, 0.0)

    def cross(x, y):
        whole = np.fft.irfft(np.conj(transform(x)) * transform(y), size)
        return np.concatenate([whole[-reach:], whole[:reach + 1]]) if reach else whole[:1]

    count = np.maximum(np.round(cross(masks[0], masks[1])), 0.0)
    safe = np.maximum(count, 1.0)
    mean_a, mean_b = cross(a, masks[1]) / safe, cross(masks[0], b) / safe
    variance_a = np.maximum(cross(a * a, masks[1]) / safe - mean_a ** 2, 0.0)
    variance_b = np.maximum(cross(masks[0], b * b) / safe - mean_b ** 2, 0.0)
    spread = np.sqrt(variance_a * variance_b)
    covariance = cross(a, b) / safe - mean_a * mean_b
    return np.where(spread > 1e-12, covariance / np.maximum(spread, 1e-12), 0.0), count


def find_lag(first_t, first, second_t, second, reach_s, least_support=40):
    """The Lag at which two series of the same quantity agree best; None where they are too short or do not change.

    The sign does not matter: where the correlation is negative, one of them has the wrong one.
    """
    first_t, first = in_order(first_t, first)
    second_t, second = in_order(second_t, second)
    if len(first_t) < 5 or len(second_t) < 5:
        return None
    grid, step = common_grid(first_t, second_t, reach=reach_s)
    if not 5 <= len(grid) <= LONGEST_SERIES:
        return None
    a, a_valid = resample(first_t, first, grid, step)
    b, b_valid = resample(second_t, second, grid, step)
    reach = int(min(reach_s / step, len(grid) - 1))
    values, count = correlate(a, a_valid, b, b_valid, reach)
    enough = count >= max(least_support, 0.3 * np.max(count))
    if not enough.any() or np.max(np.abs(values[enough])) == 0.0:
        return None
    size = np.where(enough, np.abs(values), 0.0)
    # Of lags that are as good, the shortest: turns to and fro repeat themselves.
    peaks = np.flatnonzero((size >= np.maximum(np.roll(size, 1), np.roll(size, -1))) & (size > AS_GOOD * np.max(size)))
    best = int(peaks[np.argmin(np.abs(peaks - reach))]) if len(peaks) else int(np.argmax(size))
    others = np.abs(np.arange(len(size)) - best) * step > NEAR_S
    unique = not others.any() or np.max(size[others]) < NEARLY_AS_GOOD * size[best]
    return Lag((best - reach + _vertex(np.abs(values), best)) * step, float(values[best]), float(values[reach]),
               int(count[best]), bool(unique))


def _vertex(values, best):
    """Where the parabola through the greatest value and its neighbours has its top, in samples from it."""
    if not 0 < best < len(values) - 1:
        return 0.0
    left, top, right = values[best - 1:best + 2]
    bend = left - 2.0 * top + right
    return float(np.clip(0.5 * (left - right) / bend, -0.5, 0.5)) if bend < 0.0 else 0.0
