"""How a program of the package is started."""

import os


def program(name):
    """The command: from the folder URBAN_GNSS_PROGRAMS where that is set, else as rosrun finds it."""
    programs = os.environ.get("URBAN_GNSS_PROGRAMS")
    return [os.path.join(programs, name)] if programs else ["rosrun", "urban_gnss_localization", name]
