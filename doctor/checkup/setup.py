"""What the localizer is told: frames and antenna, out of a params file as localization.launch takes it."""

from collections import namedtuple

# Defaults of config/localization.yaml.
Setup = namedtuple("Setup", "map_frame odom_frame base_link_frame antenna_offset given_antenna section")
DEFAULTS = Setup("map", "odom", "base_link", (0.0, 0.0), False, "imm_ekf")
LOCALIZERS = ("imm_ekf", "switching_particle_filter", "ukf", "complementary_ekf", "particle_filter")


class BadSetup(Exception):
    """The message names what is wrong."""


def setup_of(content):
    """The Setup of a params file that was read, with a section for each node."""
    if content is None:
        return DEFAULTS
    if not isinstance(content, dict):
        raise BadSetup("is no map of parameters")
    for name, values in content.items():
        if values is None:
            raise BadSetup("{0} is empty: write {0}: {{}}, or take it out".format(name))
        if not (isinstance(values, dict) or "/" in str(name)):
            raise BadSetup("{0} stands outside of a section and is not read: write {1}: {{{0}: ...}}".format(
                name, DEFAULTS.section))
    section = next((name for name in LOCALIZERS if isinstance(content.get(name), dict)), None)
    values = content[section] if section else {}
    changes = {"section": section or DEFAULTS.section}
    for name in ("map_frame", "odom_frame", "base_link_frame"):
        if name in values:
            if not isinstance(values[name], str):
                raise BadSetup("{} must be a text".format(name))
            changes[name] = values[name].lstrip("/")
    offset = values.get("antenna_offset")
    if offset is not None:
        try:
            x, y = (float(value) for value in offset)
        except (TypeError, ValueError):
            raise BadSetup("antenna_offset must be two numbers, [x, y] in m")
        changes.update(antenna_offset=(x, y), given_antenna=(x, y) != (0.0, 0.0))
    return DEFAULTS._replace(**changes)
