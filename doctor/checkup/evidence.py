"""What several checks need, worked out once: clean series, the motion, and how it fits the receiver's."""

import numpy as np

from . import fits, geodesy, signals

MOVING_MPS = 0.2         # slower is standing, for checks of motion
LEAST_WAY_M = 10.0       # within a window, for it to say something of the motion
BELIEVABLE_MPS = 1e5     # also in mm/s; faster is no speed at all
LONGEST_S = 2e5          # from the median stamp: more is another clock, not a drive


def imu_yaw_rate(imu, mounting=None):
    """The yaw rate that a localizer takes, and which messages have an orientation.

    It is that about the vertical where the message has an orientation, else about z of the robot as tf has the IMU
    mounted (`mounting`: x, y, z and quaternion in base_link), else about its own z.
    """
    quaternion = np.array([imu.qw, imu.qx, imu.qy, imu.qz])
    norm = np.sqrt(np.sum(quaternion ** 2, axis=0))
    oriented = (imu.orientation_cov != -1.0) & (np.abs(norm - 1.0) < 0.1)
    w, x, y, z = quaternion / np.where(norm > 0.0, norm, 1.0)
    own = imu.wz if mounting is None else along_z(imu, *mounting[3:])
    return np.where(oriented, along_z(imu, x, y, z, w), own), oriented


def along_z(imu, x, y, z, w):
    """The part of the angular velocity along the z axis of the frame that a quaternion turns into."""
    return 2.0 * (x * z - w * y) * imu.wx + 2.0 * (y * z + w * x) * imu.wy + (1.0 - 2.0 * (x * x + y * y)) * imu.wz


def stamps(stream, good=True):
    """The stamps, NaN where a message is not good or its stamp is none of this drive."""
    some = stream.t > 0.0
    centre = signals.median(stream.t[some])
    return np.where(good & some & (np.abs(stream.t - centre) < LONGEST_S), stream.t, np.nan)


def is_place(lat, lon):
    """Whether latitudes and longitudes are some, and not the (0, 0) of a receiver that has no fix."""
    with np.errstate(invalid="ignore"):
        return (np.isfinite(lat) & np.isfinite(lon) & (np.abs(lat) <= 90.0) & (np.abs(lon) <= 360.0)
                & ((np.abs(lat) > 1e-9) | (np.abs(lon) > 1e-9)))


class Evidence:
    """A recording as the checks look at it. What a recording does not have is None."""

    def __init__(self, recording, setup):
        self.recording = recording
        self.setup = setup
        self.motion = self._odometry(recording.odometry)          # (t, velocity in the robot's frame, yaw rate)
        self.imu_rate = self._imu(recording.imu, self.imu_mounting())  # (t, yaw rate)
        self.fixes = self._fixes(recording.fix)                   # (t, place, declared sigma or NaN)
        self.velocities = self._velocities(recording.velocity)    # (t, velocity, east + i north)
        self.tracks = self._tracks()                              # {"odometry", "imu"}: fits.Track
        # Set by checks for those after them, so that one fault is told once:
        self.yaw_source = "odometry"    # of the track that fits best
        self.twist_is_wrong = False     # it is not in the robot's frame
        self.velocity_is_good = False   # the receiver's, by its own fixes

    @staticmethod
    def _odometry(odometry):
        if odometry is None or len(odometry) < 2:
            return None
        believable = np.hypot(odometry.vx, odometry.vy) < BELIEVABLE_MPS
        t, vx, vy, wz = signals.in_order(stamps(odometry, believable), odometry.vx, odometry.vy, odometry.wz)
        return (t, vx + 1j * vy, wz) if len(t) > 1 else None

    @staticmethod
    def _imu(imu, mounting):
        if imu is None or len(imu) < 2:
            return None
        rate, _ = imu_yaw_rate(imu, mounting)
        t, rate = signals.in_order(stamps(imu), rate)
        return (t, rate) if len(t) > 1 else None

    @staticmethod
    def _fixes(fix):
        if fix is None:
            return None
        good = is_place(fix.lat, fix.lon) & (fix.status >= 0)
        with np.errstate(invalid="ignore"):
            sigma = np.sqrt(np.where((fix.cov_xx > 0.0) & (fix.cov_yy > 0.0), 0.5 * (fix.cov_xx + fix.cov_yy), 0.0))
        t, lat, lon, sigma = signals.in_order(stamps(fix, good), fix.lat, fix.lon, sigma)
        if len(t) < 2:
            return None
        return t, geodesy.to_plane(lat, lon), np.where(sigma > 0.0, sigma, np.nan)

    @staticmethod
    def _velocities(velocity):
        if velocity is None:
            return None
        believable = np.hypot(velocity.vx, velocity.vy) < BELIEVABLE_MPS
        t, east, north = signals.in_order(stamps(velocity, believable), velocity.vx, velocity.vy)
        return (t, east + 1j * north) if len(t) > 1 else None

    def imu_mounting(self):
        """The IMU's pose in base_link by a static transform; None where there is none."""
        imu = self.recording.imu
        if imu is None:
            return None
        return self.recording.transforms.static_pose(self.setup.base_link_frame, imu.frame().lstrip("/"))

    def correct_yaw_rate(self, source, factor):
        """Another unit or sign for a yaw rate, where the recorded one is wrong in a way that is known."""
        if source == "odometry":
            self.motion = self.motion[:2] + (factor * self.motion[2],)
        else:
            self.imu_rate = self.imu_rate[0], factor * self.imu_rate[1]
        self.tracks = self._tracks()

    def _tracks(self):
        tracks = {}
        if self.motion is None:
            return tracks
        t, velocity, rate = self.motion
        tracks["odometry"] = fits.Track(t, velocity, rate)
        mean_rate = self.imu_rate_at(t)
        if mean_rate is not None:
            tracks["imu"] = fits.Track(t, velocity, mean_rate)
        return tracks

    def shift(self, kind, lag):
        """Takes a clock's offset out of fixes, velocities or IMU, where they are (s, positive: stamps ahead)."""
        name = {"fix": "fixes", "velocity": "velocities", "imu": "imu_rate"}[kind]
        series = getattr(self, name)
        if series is not None:
            setattr(self, name, (series[0] - lag,) + series[1:])
            self.tracks = self._tracks() if kind == "imu" else self.tracks

    def replace_places(self, places):
        """Other places for the fixes, where the recorded ones are wrong in a way that is known."""
        self.fixes = (self.fixes[0], places, self.fixes[2])

    def imu_rate_at(self, t):
        """The IMU's mean yaw rate over the time before each of `t`; None where it does not cover most of them."""
        if self.imu_rate is None:
            return None
        imu_t, rate = self.imu_rate
        covered = signals.gaps_mask(imu_t, t, max(1.0, 3.0 * signals.period(imu_t)))
        if np.mean(covered) < 0.8:
            return None
        dt = np.minimum(np.diff(imu_t, prepend=imu_t[0]), fits.LONGEST_GAP_S)
        yaw = np.interp(t, imu_t, np.cumsum(rate * dt))
        step = np.diff(t, prepend=t[0] - 1.0)
        return np.where(covered, np.diff(yaw, prepend=yaw[0]) / np.maximum(step, 1e-3), 0.0)

    def track(self):
        """The motion with the yaw rate that fits best; None without odometry."""
        return self.tracks.get(self.yaw_source) or self.tracks.get("odometry")

    def moves(self):
        """Whether odometry or receiver say that the robot drove at all."""
        return self.odometry_way() > LEAST_WAY_M or self.receiver_way() > LEAST_WAY_M

    def odometry_way(self):
        """m, by the twist."""
        return float(self.tracks["odometry"].way[-1]) if "odometry" in self.tracks else 0.0

    def receiver_way(self):
        """m, by the receiver's velocity, or by fixes half a minute apart beyond their errors."""
        way = 0.0
        if self.velocities is not None:
            t, velocity = self.velocities
            speed = np.abs(velocity)
            dt = np.minimum(np.diff(t, prepend=t[0]), fits.LONGEST_GAP_S)
            way = float(np.sum(np.where(speed > 0.5, speed, 0.0) * dt))
        if self.fixes is not None and way == 0.0:
            t, place, _ = self.fixes
            grid = np.arange(t[0], t[-1], 30.0)
            if len(grid) > 1:
                mean = np.interp(grid, t, place.real) + 1j * np.interp(grid, t, place.imag)
                steps = np.abs(np.diff(mean))
                way = float(np.sum(np.where(steps > 15.0, steps, 0.0)))
        return way
