"""Where the antenna is, by the fixes while the robot turns, against where it is said to be."""

import numpy as np

from . import fits, motion_fit
from .evidence import LEAST_WAY_M
from .finding import passed, warned

ITERATIONS = 6
INFLATION = 4.0        # errors of fixes last for many fixes: as if there were a sixteenth of them
SYSTEMATIC_M = 0.15    # what a yaw rate that is off by some per cent adds
SURE_SIGMA_M = 0.35    # a vaguer place is not said
OFF_M, OFF_SIGMAS = 0.5, 3.0
DELAY_LIMIT_S = 3.0


def check(evidence):
    """All findings of this family."""
    found = estimate(evidence)
    if found is None:
        return []
    offset, sigma = found
    name, fix = "antenna.offset", evidence.recording.fix
    values = dict(x_m=offset[0], y_m=offset[1], sigma_x_m=sigma[0], sigma_y_m=sigma[1])
    text = "the antenna is at x {:+.2f} +- {:.2f}, y {:+.2f} +- {:.2f} m of {}, by the fixes".format(
        offset[0], sigma[0], offset[1], sigma[1], evidence.setup.base_link_frame)
    if max(sigma) > SURE_SIGMA_M:
        return [passed(name, "too few turns, or too rough fixes, to find the antenna's place", **values)]
    said, source = configured(evidence)
    distance = np.array(offset) - said
    values.update(configured_x_m=float(said[0]), configured_y_m=float(said[1]))
    text += "; {} says {:+.2f}, {:+.2f}".format(source, *said)
    if np.hypot(*distance) > OFF_M and np.any(np.abs(distance) > OFF_SIGMAS * np.array(sigma)):
        return [warned(name, text, "{}: {{antenna_offset: [{:.2f}, {:.2f}]}}  # measure it, or correct tf to {}".format(
            evidence.setup.section, offset[0], offset[1], fix.frame() or "its frame"), **values)]
    return [passed(name, text, **values)]


def configured(evidence):
    """(x, y) of the antenna by parameter or tf, and which of them."""
    setup, recording = evidence.setup, evidence.recording
    if setup.given_antenna:
        return np.array(setup.antenna_offset), "antenna_offset"
    pose = recording.transforms.static_pose(setup.base_link_frame, recording.fix.frame().lstrip("/"))
    if pose is not None:
        return np.array(pose[:2]), "tf"
    return np.zeros(2), "the default"


def estimate(evidence):
    """((x, y), (sigma, sigma)) m; None where nothing can be said. Solves for a delay too, which looks like an x."""
    track = evidence.track()
    if evidence.fixes is None or track is None or track.way[-1] < 5.0 * LEAST_WAY_M:
        return None
    t, q, _ = evidence.fixes
    parts = motion_fit.useful_windows(track, t, q, track.t)
    if len(parts) < 6:
        return None
    parts = motion_fit.most_turning(track, t, parts)
    parts = [part for part in parts if np.std(track.yaw_at(t[part])) > 0.2]
    if len(parts) < 4:
        return None
    lever, delay, sigma = 0.0 + 0.0j, 0.0, (np.inf, np.inf)
    for _ in range(ITERATIONS):
        solved = step(track, t, q, parts, lever, delay)
        if solved is None:
            return None
        change, delay_change, sigma = solved
        lever, delay = lever + change, float(np.clip(delay + delay_change, -DELAY_LIMIT_S, DELAY_LIMIT_S))
    if not np.isfinite(lever) or abs(lever) > 20.0:
        return None
    return (float(lever.real), float(lever.imag)), sigma


def step(track, t, q, parts, lever, delay):
    """One step of Gauss and Newton: change of lever (complex, m) and delay (s), and sigma of the lever's parts."""
    normal, right, squares, count = np.zeros((3, 3)), np.zeros(3), 0.0, 0
    for part in parts:
        at = t[part] - delay
        heading = np.exp(1j * track.yaw_at(at))
        p = track.place_at(at) + lever * heading
        found = fits.fit(p, q[part])
        turn, weights = np.exp(1j * found.rotation), found.weights
        # Derivatives by the lever's x and y, the delay, and (to be projected out) the window's turn and place.
        columns = np.array([turn * heading, 1j * turn * heading, -turn * track.velocity_at(at)])
        nuisance = np.array([1j * turn * (p - np.mean(p)), np.ones(len(p), complex), 1j * np.ones(len(p), complex)])
        root = np.sqrt(weights)
        design = np.concatenate([(columns * root).real, (columns * root).imag], axis=1).T
        other = np.concatenate([(nuisance * root).real, (nuisance * root).imag], axis=1).T
        residual = np.concatenate([(found.residuals * root).real, (found.residuals * root).imag])
        basis, _ = np.linalg.qr(other)
        design = design - basis @ (basis.T @ design)
        residual = residual - basis @ (basis.T @ residual)
        normal += design.T @ design
        right += design.T @ residual
        squares += float(residual @ residual)
        count += int(np.sum(weights > 0.1))
    if not np.all(np.isfinite(normal)) or np.linalg.cond(normal) > 1e8 or count < 20:
        return None
    inverse = np.linalg.inv(normal)
    change = inverse @ right
    sigma = INFLATION * np.sqrt(squares / count * np.diag(inverse))
    return change[0] + 1j * change[1], change[2], tuple(float(np.hypot(each, SYSTEMATIC_M)) for each in sigma[:2])
