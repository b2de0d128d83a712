"""The fixes as places: where on Earth, what status, swapped or in another unit."""

import numpy as np

from . import fits, geodesy, motion_fit, signals
from .evidence import is_place, stamps
from .finding import failed, passed, warned

FEW = 0.01
NO_FIX_WARN = 0.2          # share of messages with status -1
FROZEN_S = 5.0
LEAST_WAY_M = 10.0
STRETCHED_GAIN = 0.1
UNITS = ((1e7, "degrees times 10^7"), (1e6, "microdegrees"), (1e3, "millidegrees"),
         (100.0, "degrees and minutes (DDMM.MMMM)"))


def check(evidence):
    """All findings of this family."""
    fix = evidence.recording.fix
    if fix is None or len(fix) == 0:
        return []
    findings = place(fix)
    findings += status(fix) + altitude(fix)
    if not any(finding.level == "FAIL" for finding in findings):
        findings += swapped(evidence) + radians(evidence) + frozen(evidence)
    return findings


def place(fix):
    """Latitudes and longitudes that are none."""
    topic, count = fix.topic, len(fix)
    name = "fix.place"
    has_fix = fix.status >= 0
    if not has_fix.any():
        return []
    lat, lon = fix.lat[has_fix], fix.lon[has_fix]
    bad = int(np.sum(~(np.isfinite(lat) & np.isfinite(lon))))
    zero = int(np.sum((np.abs(lat) < 1e-9) & (np.abs(lon) < 1e-9)))
    with np.errstate(invalid="ignore"):
        outside = (np.abs(lat) > 90.0) | (np.abs(lon) > 360.0)
    change = "in the driver: latitude and longitude in degrees, in this order"
    if np.sum(outside) > FEW * count:
        size = signals.median(np.maximum(np.abs(lat[outside]), np.abs(lon[outside])))
        if signals.median(np.abs(lat[outside])) <= 180.0 and signals.median(np.abs(lon[outside])) <= 90.0:
            return [failed(name, "{}: latitude {:.4f} is none, longitude {:.4f} could be one: latitude and longitude "
                           "are swapped".format(topic, lat[outside][0], lon[outside][0]), change)]
        # The greatest unit that leaves a place.
        unit = next((text for value, text in UNITS if size / value > 1.0), "another unit")
        return [failed(name, "{}: latitude {:.6g}, longitude {:.6g} are no degrees: {}?".format(
            topic, lat[outside][0], lon[outside][0], unit), change)]
    findings = []
    if bad:
        findings.append((failed if bad > 0.5 * count else warned)(
            name, "{}: {} of {} fixes have no finite place, though their status says that they have".format(
                topic, bad, count), "in the driver: status -1 where there is no fix", count=bad))
    if zero:
        findings.append((failed if zero > 0.5 * count else warned)(
            name, "{}: {} of {} fixes are at latitude 0, longitude 0: no fix".format(topic, zero, count),
            "in the driver: status -1 where there is no fix", count=zero))
    return findings or [passed(name, "{}: places about {:.5f}, {:.5f}".format(
        topic, signals.median(lat), signals.median(lon)))]


def status(fix):
    """How often the receiver says that it has no fix."""
    without = float(np.mean(fix.status < 0))
    text = "{}: {:.0f} % of the messages say that there is no fix (status -1)".format(fix.topic, 100.0 * without)
    good = is_place(fix.lat, fix.lon)
    if without > 0.9 and np.mean(good) > 0.5:
        return [failed("fix.status", text + ", though they have places", "in the driver (or simulator): status.status "
                       "= 0 where there is a fix", share=without)]
    if without > NO_FIX_WARN:
        return [warned("fix.status", text, "an antenna with a view of the sky, a better place, more constellations",
                       share=without)]
    return [passed("fix.status", text, share=without)]


def altitude(fix):
    """Nothing depends on it, but it is good to know."""
    bad = int(np.sum(~np.isfinite(fix.alt)))
    if bad == 0:
        return []
    return [passed("fix.altitude", "{}: {} of {} have no altitude; it is not needed".format(fix.topic, bad, len(fix)))]


def swapped(evidence):
    """Latitude and longitude in each other's field, where both are possible: the motion tells."""
    fix = evidence.recording.fix
    if evidence.fixes is None:
        return []
    good = is_place(fix.lat, fix.lon) & is_place(fix.lon, fix.lat) & (fix.status >= 0)
    if np.mean(good) < 0.9:
        return []
    lag = signals.median(stamps(fix)) - signals.median(evidence.fixes[0])  # that the check of clocks took out
    t, lat, lon = signals.in_order(stamps(fix, good) - (lag if abs(lag) < 60.0 else 0.0), fix.lat, fix.lon)
    q, other_q = geodesy.to_plane(lat, lon), geodesy.to_plane(lon, lat)
    verdict = swapped_by_velocity(evidence, t, q, other_q)
    if verdict is None:
        verdict = swapped_by_tracks(evidence, t, q, other_q)
    if not verdict:
        return []
    if verdict == "perhaps":
        return [warned("fix.swapped", "{}: the way is a mirror image of the odometry's: latitude and longitude are "
                       "swapped, or the yaw rate has the reversed sign".format(fix.topic),
                       "in the driver: latitude and longitude in this order")]
    if len(t) == len(evidence.fixes[0]):
        evidence.replace_places(other_q)  # so that the other checks see past it
    return [failed("fix.swapped", "{}: the way fits the motion only with latitude and longitude swapped ({:.5f}, "
                   "{:.5f} would be the place)".format(fix.topic, signals.median(fix.lon), signals.median(fix.lat)),
                   "in the driver: latitude and longitude in this order")]


def swapped_by_velocity(evidence, t, q, other_q):
    """Whether the receiver's velocity fits the way only with the fields swapped; None where it does not tell."""
    if evidence.velocities is None:
        return None
    velocity_t, values = evidence.velocities
    track = fits.Track(velocity_t, values, np.zeros(len(values)))
    parts = [part for part in motion_fit.useful_windows(track, t, q, velocity_t)
             if motion_fit.extent(q[part]) > 0.25 * LEAST_WAY_M]
    if len(parts) < motion_fit.LEAST_WINDOWS:
        return None
    place = track.place_at(t)
    plain = motion_fit.read_unturned("", place, t, q, parts)
    other = motion_fit.read_unturned("", place, t, other_q, parts)
    # A velocity with x north looks like a mirror, too, and one that is turned like half of one; swapped degrees are
    # stretched besides.
    wrong_velocities = [motion_fit.read_unturned("", each, t, q, parts)
                        for each in (1j * np.conj(place), 1j * place, -1j * place, -place)]
    if not motion_fit.clearly_better(other, plain):
        return False if motion_fit.clearly_better(plain, other) else None
    return all(motion_fit.gain(other, each)[0] > STRETCHED_GAIN for each in wrong_velocities)


def swapped_by_tracks(evidence, t, q, other_q):
    """The same by odometry and IMU; "perhaps" where a reversed yaw rate would look the same."""
    stretched = False
    for track in evidence.tracks.values():
        parts = motion_fit.most_turning(track, t, motion_fit.useful_windows(track, t, q, track.t))
        if len(parts) < motion_fit.LEAST_WINDOWS:
            return False
        plain = motion_fit.read("", "", track, t, q, parts)
        mirror = motion_fit.read("", "", track, t, np.conj(q), parts)
        other = motion_fit.read("", "", track, t, other_q, parts)
        if not motion_fit.clearly_better(other, plain):
            return False
        stretched |= motion_fit.gain(other, mirror)[0] > STRETCHED_GAIN
    if not evidence.tracks:
        return False
    return True if stretched or len(evidence.tracks) > 1 else "perhaps"


def radians(evidence):
    """Radians in place of degrees: a place off Africa, and a way that is 57 times too short."""
    fix = evidence.recording.fix
    lat, lon = signals.median(fix.lat), signals.median(fix.lon)
    if not (abs(lat) < np.pi / 2 and abs(lon) < np.pi):
        return []
    ways = (evidence.odometry_way(), evidence.receiver_way())
    if ways[0] > 5.0 * LEAST_WAY_M and evidence.fixes is not None:
        _, q, _ = evidence.fixes
        if motion_fit.extent(q) < 0.03 * ways[0]:
            return [failed("fix.place", "{}: latitude {:.4f}, longitude {:.4f}, and the fixes hardly move: radians in "
                           "place of degrees".format(fix.topic, lat, lon), "in the driver: degrees")]
    return [warned("fix.place", "{}: latitude {:.4f}, longitude {:.4f} is in the sea off Africa: radians in place of "
                   "degrees?".format(fix.topic, lat, lon), "in the driver: degrees")]


def frozen(evidence):
    """The same place again and again while the robot drives."""
    track = evidence.track()
    if track is None or evidence.fixes is None:
        return []
    t, q, _ = evidence.fixes
    same = np.concatenate([[False], np.abs(np.diff(q)) < 1e-6])
    edges = np.flatnonzero(np.diff(np.concatenate([[0], same.astype(int), [0]])))
    spans = []
    for begin, end in zip(edges[::2], edges[1::2]):
        if t[end - 1] - t[begin - 1] > FROZEN_S and track.way_at(t[end - 1]) - track.way_at(t[begin - 1]) > LEAST_WAY_M:
            spans.append((t[begin - 1], t[end - 1]))
    if not spans:
        return []
    total = sum(end - begin for begin, end in spans)
    return [warned("fix.frozen",
                   "{}: the same place for {:.0f} s in all while the robot drives (from {:.0f} s on)".format(
        evidence.recording.fix.topic, total, spans[0][0] - evidence.recording.first_stamp()),
        "in the driver: a message for each solution, status -1 where there is none", frozen_s=total, spans=spans)]
