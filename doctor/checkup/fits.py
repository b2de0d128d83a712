"""Where the odometry's track, turned and shifted, fits what the receiver says: window by window, robustly.

Places and velocities are complex numbers, x + i y. A window is short enough that the odometry's drift is small beside
the receiver's errors, and long enough that the receiver's errors do not hide the motion.
"""

from collections import namedtuple

import numpy as np

from . import signals

WINDOW_S = 30.0
LEAST_POINTS = 6
LONGEST_GAP_S = 3.0      # of the odometry within a window
MOST_WINDOWS = 60        # that a search looks at: those with most turns and changes of speed
ITERATIONS = 4           # of the reweighting; more change nothing that matters

# rotation rad, scale, residuals m or m/s (complex)
Fit = namedtuple("Fit", "rotation scale residuals weights")


def fit(p, q, centred=True, free_scale=False):
    """The rotation (and shift, and scale) of p that fits q best, with weights that outliers do not rule."""
    origin = p[0] if centred else 0.0
    p = p - origin  # for digits: a track may be far from its beginning
    q = q - q[0] if centred else q
    weights, half = np.ones(len(p)), len(p) // 2
    conjugate = np.conj(p)
    # Sums as products, and a median by partition: this runs some thousand times.
    for _ in range(ITERATIONS):
        total = weights.sum()
        p_mean, q_mean = (weights @ p / total, weights @ q / total) if centred else (0.0, 0.0)
        product = (weights * conjugate) @ q - total * np.conj(p_mean) * q_mean
        power = weights @ (p.real ** 2 + p.imag ** 2) - total * abs(p_mean) ** 2
        rotation = product / abs(product) if abs(product) > 0.0 else 1.0
        scale = abs(product) / power if power > 0.0 else float("nan")
        factor = rotation * (scale if free_scale and np.isfinite(scale) else 1.0)
        residuals = (q - q_mean) - factor * (p - p_mean)
        squares = residuals.real ** 2 + residuals.imag ** 2
        weights = 1.0 / (1.0 + squares / max(np.partition(squares, half)[half], 1e-12))  # Cauchy's
    return Fit(float(np.angle(rotation)), float(scale), residuals, weights)


class Track:
    """A motion that was integrated: places and headings at times, and the velocity along it."""

    def __init__(self, t, velocity, yaw_rate):
        """`velocity` complex, in the robot's frame; each value holds since the time before it, as in the pipeline."""
        self.t = t
        dt = np.diff(t, prepend=t[0])
        dt = np.where(dt <= LONGEST_GAP_S, dt, 0.0)
        turn = yaw_rate * dt
        self.yaw = np.cumsum(turn)
        self.velocity = velocity * np.exp(1j * (self.yaw - 0.5 * turn))
        self.place = np.cumsum(self.velocity * dt)
        self.way = np.cumsum(np.abs(velocity) * dt)
        self.centre = t - 0.5 * dt  # of the time in which a velocity holds

    def place_at(self, t):
        """Complex places."""
        return np.interp(t, self.t, self.place.real) + 1j * np.interp(t, self.t, self.place.imag)

    def velocity_at(self, t):
        """Complex velocities, in the track's frame."""
        return np.interp(t, self.centre, self.velocity.real) + 1j * np.interp(t, self.centre, self.velocity.imag)

    def yaw_at(self, t):
        """Headings, rad, not wrapped."""
        return np.interp(t, self.t, self.yaw)

    def way_at(self, t):
        """Length of the way from the beginning, m."""
        return np.interp(t, self.t, self.way)


def windows(t, covered_t, length=WINDOW_S):
    """Slices of `t` of the given length, half overlapping, with enough points and no gap in what covers them."""
    found = []
    if len(t) < LEAST_POINTS:
        return found
    if len(covered_t) > 1:
        holes = np.flatnonzero(np.diff(covered_t) > LONGEST_GAP_S)
        hole_begins, hole_ends = covered_t[holes], covered_t[holes + 1]
    else:
        return found
    begin = t[0]
    while begin < t[-1]:
        low, high = np.searchsorted(t, [begin, begin + length])
        begin = max(begin + 0.5 * length, t[low]) if high == low else begin + 0.5 * length
        if high - low < LEAST_POINTS or t[high - 1] - t[low] < 0.5 * length:
            continue
        if t[low] < covered_t[0] or t[high - 1] > covered_t[-1]:
            continue
        if np.any((hole_begins < t[high - 1]) & (hole_ends > t[low])):
            continue
        found.append(slice(low, high))
    return found


def excitation(t, places):
    """How far a motion is from a straight line at constant speed, m (rms): what a delay or a lever arm shows in."""
    centred = t - np.mean(t)
    power = np.sum(centred ** 2)
    offset = places - np.mean(places)
    straight = np.sum(centred * offset) / power * centred if power > 0.0 else 0.0
    return float(np.sqrt(np.mean(np.abs(offset - straight) ** 2)))


def most_excited(track, t, parts, count=MOST_WINDOWS):
    """The windows in which the motion changes most, in their order."""
    value = [excitation(t[part], track.place_at(t[part])) for part in parts]
    best = sorted(range(len(parts)), key=lambda k: value[k], reverse=True)[:count]
    return [parts[k] for k in sorted(best)]


def window_fits(track, t, q, parts, lag=0.0, of_velocity=False, free_scale=False):
    """A Fit for each window; events of q are `lag` later than their stamps say is the track's."""
    p = track.velocity_at(t - lag) if of_velocity else track.place_at(t - lag)
    return [fit(p[part], q[part], not of_velocity, free_scale) for part in parts]


def cost(fits, spread):
    """How badly fits are off, given the usual size of a residual: less is better, outliers count little."""
    return np.array([np.mean(np.log1p((np.abs(each.residuals) / spread) ** 2)) for each in fits])


def spread_of(fits):
    """The usual size of a residual over all windows."""
    if not fits:
        return float("nan")
    return max(signals.median(np.concatenate([np.abs(each.residuals) for each in fits])), 1e-3)
