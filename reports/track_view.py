"""The tracks of `evaluate` as a map that can be zoomed, with what is known of them over time, inside a page."""

import json
import os

import report_common as common

SCRIPT = os.path.join(os.path.dirname(os.path.realpath(__file__)), "track_view.js")
COLUMNS = {"estimate": ("t", "x", "y", "xx", "xy", "yy", "sigma", "speed"),
           "fixes": ("t", "x", "y", "sigma", "decision", "reason", "nis", "nis_threshold"),
           "states": ("t", "state", "healthy", "reason"), "truth": ("t", "x", "y"), "errors": ("t", "error"),
           "fix_errors": ("t", "error")}
STYLE = """
.tracks canvas { width: 100%; border: 1px solid #ccc; margin-bottom: 0.5em; display: block; }
.tracks .controls { margin: 0.3em 0; font-size: 0.92em; }
.tracks label, .tracks .entry { margin-right: 1.2em; white-space: nowrap; }
.tracks .tip { min-height: 1.3em; margin: 0.3em 0; font-size: 0.92em; color: #444; }
"""


def read_track(path):
    """The content of a track_*.json, with every column that the page reads."""
    track = common.read_json(path)
    for part, columns in COLUMNS.items():
        content = common.require_object(track, part, path)
        for column in columns:
            if not isinstance(content.get(column), list):
                raise common.ReportError("{}: missing list {}.{}".format(path, part, column))
    return track


def inside_script(content):
    """JSON that no </script> within a text can end."""
    return json.dumps(content, ensure_ascii=False, separators=(",", ":")).replace("<", "\\u003c")


def add_tracks(page, tracks, colours):
    """Map and plots; `colours` by the tracks' names."""
    with open(SCRIPT, encoding="utf-8") as stream:
        script = stream.read()
    coloured = [dict(track, colour=colours[track["name"]]) for track in tracks]
    page.fragment('<style>{}</style><div class="tracks" id="tracks"></div>\n<script>\n{}\n'
                  'drawTracks(document.getElementById("tracks"), {});\n</script>'.format(
                      STYLE, script, inside_script(coloured)))
    page.paragraph("Wheel or two fingers zoom, dragging moves, a double click shows all. Crosses: rejected fixes. "
                   "Ellipses hold the truth with 95 %, if the estimate's covariance is right. Red in the plots: times "
                   "without a fix that was used. Pale in the line of states: not healthy.")
