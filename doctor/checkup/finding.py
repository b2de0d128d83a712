"""What a check says."""

from collections import namedtuple

PASS, WARN, FAIL = "PASS", "WARN", "FAIL"
LEVELS = (PASS, WARN, FAIL)

# `check`: family.name; `text`: one sentence with the numbers; `change`: lines to write or type; `values`: the numbers.
# The value `spans`, where there is one: (begin, end) of each time that is meant, s as in the stamps.
Finding = namedtuple("Finding", "check level text change values")


def passed(check, text, **values):
    """Nothing to do."""
    return Finding(check, PASS, text, (), values)


def warned(check, text, *change, **values):
    """Worse than need be, or not sure."""
    return Finding(check, WARN, text, change, values)


def failed(check, text, *change, **values):
    """Wrong: localization will suffer."""
    return Finding(check, FAIL, text, change, values)


def worst(findings):
    """The gravest level among them."""
    return max((finding.level for finding in findings), key=LEVELS.index, default=PASS)


def family(finding):
    """The part of the check's name before the dot."""
    return finding.check.split(".")[0]
