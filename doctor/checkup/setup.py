"""What the localizer is told: frames and antenna, out of a params file as localization.launch takes it."""

from collections import namedtuple

# Defaults of config/localization.yaml.
Setup = namedtuple("Setup", "map_frame odom_frame base_link_frame antenna_offset given_antenna section")
DEFAULTS = Setup("map", "odom", "base_link", (0.0, 0.0), False, "imm_ekf")
LOCALIZERS = ("imm_ekf", "switching_particle_filter", "ukf", "complementary_ekf", "particle_filter")


def sections(content):
    """Name and values of the sections for localizers, also of those in namespaces and under names with slashes."""
    for path, values in content.items():
        name = str(path).split("/")[-1]
        if name in LOCALIZERS:
            yield name, values or {}
        elif isinstance(values, dict) and name != "expert":
            yield from sections(values)


def setup_of(content):
    """The Setup of a params file that the nodes would take: of its first section for a localizer."""
    section, values = next(sections(content), (None, {}))
    changes = {"section": section or DEFAULTS.section}
    for name in ("map_frame", "odom_frame", "base_link_frame"):
        if name in values:
            changes[name] = str(values[name]).lstrip("/")
    if "antenna_offset" in values:
        x, y = (float(value) for value in values["antenna_offset"])
        changes.update(antenna_offset=(x, y), given_antenna=(x, y) != (0.0, 0.0))
    return DEFAULTS._replace(**changes)
