"""Names of factors: which unit or mistake multiplies a speed or a yaw rate by it."""

import math

WITHIN = 0.07  # wheels are off by up to 8 %; the nearest names differ by 9 %

SPEED_UNITS = ((3.6, "km/h in place of m/s"), (2.2369, "mph in place of m/s"), (1000.0, "mm/s in place of m/s"),
               (100.0, "cm/s in place of m/s"), (3.2808, "ft/s in place of m/s"), (1.9438, "knots in place of m/s"),
               (1.0 / 3.6, "divided by 3.6 once too often"), (0.44704, "taken for mph though it is m/s"),
               (0.001, "km/s, divided by 1000 once too often"), (0.01, "divided by 100 once too often"),
               (0.5, "half: one encoder of two is dead, or counts per turn are wrong"),
               (2.0, "double: counts per turn are wrong"))
RATE_UNITS = ((180.0 / math.pi, "degrees per second in place of rad/s"),
              (math.pi / 180.0, "converted from degrees though it is in rad/s"),
              (1000.0, "mrad/s in place of rad/s"), (0.5, "half: gear or track width is wrong"),
              (2.0, "double: gear or track width is wrong"))


DEGREES_WITHIN = 0.8  # nothing else is near: wheels that slip and noise change the factor, not the unit


def rate_name_of(factor):
    """The name of a factor between yaw rates; None where it has none."""
    for value, name in RATE_UNITS[:2]:
        if factor > 0.0 and abs(math.log(factor / value)) < DEGREES_WITHIN:
            return name
    return name_of(factor, RATE_UNITS[2:])


def name_of(factor, units, within=WITHIN):
    """The unit whose factor is nearest; None where none is near."""
    if not factor > 0.0 or not math.isfinite(factor):
        return None
    value, name = min(units, key=lambda unit: abs(math.log(factor / unit[0])))
    return name if abs(math.log(factor / value)) < within else None
