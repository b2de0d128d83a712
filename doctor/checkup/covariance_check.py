"""What fixes say of their own errors, against how they scatter about the odometry's track."""

import numpy as np

from . import fits, motion_fit, signals
from .evidence import LEAST_WAY_M
from .finding import failed, passed, warned

# Scatter about the track over half a minute, over the declared sigma. Good recordings have 0.05 to 0.8: what lasts
# longer than the window is not seen. Honest receivers between buildings are off by some.
OVER_WARN, OVER_FAIL, OVER_FAIL_CONSTANT = 2.0, 30.0, 10.0
UNDER_WARN = 0.02
MEDIAN_OF_RAYLEIGH = 1.1774    # of a length whose components have sigma 1
UNRELATED = 0.5                # of a window's extent that is left: the track is not that of the fixes
TINY_SIGMA_M = 0.02            # less than a receiver with corrections has
LEAST = 20
SECTION_CHANGE = "{}: {{use_fix_covariance: false, direct_sigma: {:.1f}}}"


def check(evidence):
    """All findings of this family."""
    fix = evidence.recording.fix
    if fix is None or len(fix) < 3:
        return []
    has_fix = fix.status >= 0
    if not has_fix.any():
        return []
    fix = fix.select(has_fix)
    scatter, jitter = seen(evidence)
    findings = impossible(fix)
    known = (fix.cov_type > 0) & (fix.cov_xx > 0.0) & np.isfinite(fix.cov_xx)
    if np.mean(known) < 0.5:
        return findings + [undeclared(evidence, fix, scatter)]
    sigma = np.sqrt(np.maximum(0.5 * (fix.cov_xx + fix.cov_yy)[known], 0.0))
    findings += patterns(evidence, fix, known, sigma, scatter)
    findings += size(evidence, fix, sigma, scatter, jitter)
    return findings


def seen(evidence):
    """Sigma (m, an axis) of fixes about the odometry's track over half a minute, and of one after the other; or NaN."""
    track = evidence.track()
    if evidence.fixes is None:
        return float("nan"), float("nan")
    t, q, _ = evidence.fixes
    if track is None or track.way[-1] < LEAST_WAY_M:
        if evidence.receiver_way() > LEAST_WAY_M or len(t) < LEAST:
            return float("nan"), float("nan")
        centred = q - np.median(q.real) - 1j * np.median(q.imag)  # it stood still
        return signals.median(np.abs(centred)) / MEDIAN_OF_RAYLEIGH, step_noise(q)
    parts = motion_fit.useful_windows(track, t, q, track.t)
    if len(parts) < 3:
        return float("nan"), float("nan")
    # With a free scale: the wheels' unit is not the receiver's fault.
    all_fits = fits.window_fits(track, t, q, parts, free_scale=True)
    left = [np.median(np.abs(each.residuals)) / max(motion_fit.extent(q[part]), 1e-6)
            for each, part in zip(all_fits, parts)]
    if signals.median(left) > UNRELATED:
        return float("nan"), float("nan")
    residuals = np.concatenate([np.abs(each.residuals) for each in all_fits])
    steps = np.concatenate([np.abs(np.diff(each.residuals)) for each in all_fits])
    return signals.median(residuals) / MEDIAN_OF_RAYLEIGH, signals.median(steps) / MEDIAN_OF_RAYLEIGH / np.sqrt(2.0)


def step_noise(q):
    """Sigma of one fix after the other, at rest."""
    return signals.median(np.abs(np.diff(q))) / MEDIAN_OF_RAYLEIGH / np.sqrt(2.0)


def impossible(fix):
    """Matrices that are no covariance."""
    with np.errstate(invalid="ignore"):
        negative = (fix.cov_xx < 0.0) | (fix.cov_yy < 0.0)
        correlated = np.abs(fix.cov_xy) > 1.001 * np.sqrt(np.maximum(fix.cov_xx * fix.cov_yy, 0.0))
    used = fix.cov_type > 0
    bad = ~np.isfinite(fix.cov_xx + fix.cov_yy)
    findings = []
    for mask, what in ((negative & used, "negative variances"), (bad & used, "variances that are not finite"),
                       (correlated & used & ~negative & (np.abs(fix.cov_xy) > 1e-9), "a correlation beyond 1")):
        if np.mean(mask) > 0.01:
            findings.append(warned("covariance.matrix", "{}: {:.0f} % of the fixes have {}: no covariance".format(
                fix.topic, 100.0 * np.mean(mask), what), "in the driver; or " + SECTION_CHANGE.format("imm_ekf", 3.0),
                share=float(np.mean(mask))))
    return findings


def undeclared(evidence, fix, scatter):
    """No covariance at all."""
    text = "{}: {}".format(fix.topic, "position_covariance_type is 0 (unknown)" if np.mean(fix.cov_type == 0) > 0.5 else
                           "the covariance is all zero")
    guess = max(4.0, 2.0 * scatter) if np.isfinite(scatter) else 4.0
    return warned("covariance.declared", text + ": fix_sigma_default is taken{}".format(
        "; the fixes scatter by {:.2f} m within half a minute".format(scatter) if np.isfinite(scatter) else ""),
        "in the driver: a covariance (GST of NMEA, hAcc of u-blox)",
        "{}: {{fix_sigma_default: {:.1f}}}  # m; the default is 4".format(evidence.setup.section, guess),
        scatter_m=scatter)


def is_multiple(values, step):
    """Whether (nearly) all values are multiples of a step."""
    values = values[values > 0.0]
    return len(values) > 0 and bool(np.mean(np.abs(values / step - np.round(values / step)) < 1e-4) > 0.98)


def patterns(evidence, fix, known, sigma, scatter):
    """Mistakes of known drivers that show in the numbers."""
    findings, topic = [], fix.topic
    cov_xx, cov_zz = fix.cov_xx[known], fix.cov_zz[known]
    change = SECTION_CHANGE.format(evidence.setup.section, max(3.0, 2.0 * scatter) if np.isfinite(scatter) else 3.0)
    distinct = len(np.unique(np.round(cov_xx, 9)))
    if distinct == 1 and len(cov_xx) >= LEAST:
        findings.append(warned("covariance.constant",
                               "{}: the covariance never changes (sigma {:.3g} m): made up".format(
            topic, sigma[0]), change, sigma_m=float(sigma[0])))
    quadruple = np.mean(np.abs(cov_zz - 4.0 * cov_xx) < 1e-6 * cov_xx) > 0.98
    if quadruple and is_multiple(np.sqrt(cov_xx), 0.01) and np.mean(fix.cov_type[known] == 1) > 0.9:
        low = signals.median(sigma) < 0.4
        findings.append(warned("covariance.hdop", "{}: sigma is {} (vertical twice that): {}".format(
            topic, "0.1 m times HDOP" if low else "the HDOP itself",
            "nmea_navsat_driver takes it so for SBAS" if low else "HDOP^2 as a variance, without the receiver's error "
            "(UERE)"), "nothing: fix_sigma_default times HDOP is used; better with GST sentences of the receiver"))
    # A driver that writes millimetres of sigma into the variance: its values are round, their roots are not.
    if distinct > 10 and is_multiple(cov_xx, 0.001) and not is_multiple(np.sqrt(cov_xx), 0.001) \
            and signals.median(cov_xx) > 0.05 and not np.any(np.abs(fix.cov_xy) > 0.0):
        findings.append(warned("covariance.sigma", "{}: the variances are round numbers, as standard deviations are "
                               "(median {:.3f}): sigma in place of sigma^2, as gpsd_client writes".format(
                                   topic, signals.median(cov_xx)),
                               "localization.launch receiver:=gpsd  # takes GPSFix", change))
    if signals.median(sigma) < TINY_SIGMA_M and not (np.isfinite(scatter) and scatter < 2.0 * TINY_SIGMA_M):
        findings.append(warned("covariance.tiny", "{}: sigma is {:.2g} m: less than a receiver without corrections can "
                               "have; degrees^2 in place of m^2, or made up".format(topic, signals.median(sigma)),
                               change))
    return findings


def size(evidence, fix, sigma, scatter, jitter):
    """Seen scatter over declared sigma."""
    if not np.isfinite(scatter):
        return []
    declared = max(signals.median(sigma), 1e-9)
    ratio, colour = scatter / declared, jitter / declared
    values = dict(scatter_m=scatter, declared_m=declared, ratio=ratio, coloured_ratio=colour)
    text = ("{}: declares sigma {:.3g} m, and scatters by {:.2f} m about the odometry's track within half a minute "
            "({:.2g} times as much)".format(fix.topic, declared, scatter, ratio))
    change = SECTION_CHANGE.format(evidence.setup.section, max(3.0, 2.0 * scatter))
    constant = len(np.unique(np.round(sigma, 9))) == 1
    if ratio > OVER_WARN:
        causes = ": sigma in place of sigma^2, HDOP^2 as variance, or a receiver that ignores reflections"
        finding = failed if ratio > (OVER_FAIL_CONSTANT if constant else OVER_FAIL) else warned
        return [finding("covariance.size", text + causes, change, **values)]
    if ratio < UNDER_WARN:
        return [warned("covariance.size", text + ": far too cautious, or sigma is in cm", change, **values)]
    return [passed("covariance.size", text
                   + "; one fix after the other differs by {:.2g} of sigma: errors that last".format(
        colour), **values)]
