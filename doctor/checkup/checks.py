"""All checks of a recording, in the order in which a person would ask."""

import traceback

from . import (antenna_check, clocks_check, covariance_check, dop_check, fix_check, frames_check, imu_check, motion_fit,
               odometry_check, satellites_check, stamps_check, topics_check, velocity_check, wheels_check, yaw_check)
from .evidence import Evidence
from .finding import FAIL, LEVELS, WARN, warned

# What a check finds wrong is put right in the evidence where that can be done, so that those after it do not complain
# of the same: clocks before places, places before velocities, all before the wheels.
ORDER = (topics_check.check, stamps_check.check, frames_check.check, imu_check.check, odometry_check.check,
         clocks_check.check, fix_check.check, velocity_check.check, clocks_check.check_velocity, yaw_check.check,
         wheels_check.check, covariance_check.check, dop_check.check, antenna_check.check, satellites_check.check)


def examine(recording, setup, report=lambda name: None):
    """All findings. A check that stumbles over odd data says so and does not keep the others from their work."""
    evidence = Evidence(recording, setup)
    yaw_check.choose_source(evidence, motion_fit.readings_of(evidence))
    findings = []
    for check in ORDER:
        name = check.__module__.split(".")[-1][:-len("_check")]
        report(name)
        try:
            findings += check(evidence)
        except (ArithmeticError, IndexError, ValueError) as error:
            place = traceback.extract_tb(error.__traceback__)[-1]
            findings.append(warned(name + ".check", "these data cannot be checked ({}:{}: {})".format(
                place.filename.split("/")[-1], place.lineno, error), "please report it with the bag"))
    return gravest(findings), evidence


def gravest(findings):
    """Where a check has spoken more than once, what it passed is left out beside what it did not."""
    bad = {finding.check for finding in findings if finding.level in (WARN, FAIL)}
    return [finding for finding in findings if finding.level in (WARN, FAIL) or finding.check not in bad]


def count(findings):
    """How many of each level."""
    return {level: sum(1 for finding in findings if finding.level == level) for level in LEVELS}
