"""How well the receiver hears: strong signals, directions, residuals, and whether they belong to the fixes."""

import numpy as np

from . import signals
from .finding import passed, warned

ENOUGH_STRONG = 6        # satellites above 35 dB-Hz: a fix in which reflections can be left out
GOOD_SHARE = 0.5         # of the time; in deep streets less is usual
SAME_S = 0.01            # a fix knows its satellites by the stamp, to so much
PAIRED_SHARE = 0.9
RARE_SHARE = 0.5         # of the fixes


def check(evidence):
    """All findings of this family."""
    satellites = evidence.recording.satellites
    if satellites is None or len(satellites) == 0:
        return []
    return strength(satellites) + contents(evidence, satellites) + paired(evidence, satellites)


def strength(satellites):
    """Share of time with enough strong signals."""
    if not np.any(satellites.heard > 0):
        return [warned("satellites.cn0", "{}: no C/N0 in it".format(satellites.topic),
                       "GSV of NMEA or NAV-SAT of u-blox switched on")]
    share = float(np.mean(satellites.strong >= ENOUGH_STRONG))
    values = dict(share=share, median_strong=signals.median(satellites.strong))
    text = "{}: {:.0f} % of the time at least {} satellites above 35 dB-Hz (median {:.0f})".format(
        satellites.topic, 100.0 * share, ENOUGH_STRONG, values["median_strong"])
    if share < GOOD_SHARE:
        return [warned("satellites.cn0", text + ": weak", "the antenna on a metal plate with a view of the sky, away "
                       "from computers and USB 3; or the streets are as narrow as that", **values)]
    return [passed("satellites.cn0", text, **values)]


def contents(evidence, satellites):
    """Directions and residuals."""
    findings = []
    if np.mean(satellites.directions >= 4) < 0.5:
        findings.append(warned("satellites.directions", "{}: hardly any azimuth and elevation".format(satellites.topic),
                               "GSV of NMEA or NAV-SAT of u-blox switched on; occlusion_node needs them"))
    share = float(np.mean(satellites.residuals >= 5))
    if share < 0.5:
        findings.append(warned("satellites.residuals", "{}: residuals of at least 5 satellites in {:.0f} % of the "
                               "messages: reflected signals cannot be left out".format(satellites.topic, 100.0 * share),
                               "NAV-SAT of u-blox (rate 1), or GRS of NMEA switched on", share=share))
    else:
        findings.append(passed("satellites.residuals", "{}: residuals of {:.0f} satellites in the median".format(
            satellites.topic, signals.median(satellites.residuals)), share=share))
    return findings


def paired(evidence, satellites):
    """Whether each fix finds its satellites by the stamp."""
    fix = evidence.recording.fix
    if fix is None or len(fix) == 0:
        return []
    topic = satellites.topic
    known = [each for each in evidence.recording.topics if each.name == topic]
    if known and known[0].type != "urban_gnss_localization/SatelliteArray":
        if len(satellites) < RARE_SHARE * len(fix):
            return [warned("satellites.rate", "{}: {} messages for {} fixes".format(topic, len(satellites), len(fix)),
                           "u-blox: docs/receivers/ublox.md says how NAV-SAT comes with every solution")]
        return []  # a preset pairs them
    stamps = np.sort(satellites.t)
    place = np.clip(np.searchsorted(stamps, fix.t), 1, max(len(stamps) - 1, 1))
    near = np.minimum(np.abs(fix.t - stamps[np.minimum(place, len(stamps) - 1)]), np.abs(fix.t - stamps[place - 1]))
    share = float(np.mean(near <= SAME_S))
    text = "{}: {:.0f} % of the fixes have satellites with the same stamp".format(topic, 100.0 * share)
    if share < PAIRED_SHARE:
        return [warned("satellites.paired", text, "in the driver: the stamp of the fix, for both; or a receiver preset",
                       share=share)]
    return [passed("satellites.paired", text, share=share)]
