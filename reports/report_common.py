#!/usr/bin/env python3
"""What the report scripts share: reading their input, colours, saving figures and writing the HTML page.

The scripts read plain CSV and JSON and write PNG and HTML: no ROS, no network, numpy and matplotlib only.
"""

import base64
import html
import json
import os
import re
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402  (the backend must be chosen first)
from matplotlib.colors import to_rgb  # noqa: E402
from matplotlib.ticker import FuncFormatter, LogLocator  # noqa: E402
import numpy as np  # noqa: E402

from whole_file import NotWritten, whole_file, write_whole  # noqa: E402

FIGURE_DPI = 110

TRUTH_COLOUR = "#000000"
FIX_COLOUR = "#c2a878"
TARGET_COLOUR = "#d62728"
SHADOW_COLOUR = "#e6e9f0"

# The same method has the same colour in every figure of every report. Those that stand beside each other differ for the
# colour-blind, too.
METHOD_COLOURS = {
    "paper": "#0072b2",
    "conventional": "#d55e00",
    "literal": "#aa3377",
    "switching": "#009e73",
    "imm_ekf": "#56b4e9",
    "ekf": "#e69f00",
    "gated_ekf": "#882255",
    "complementary_ekf": "#d55e00",
    "ukf": "#8c510a",
    "dead_reckoning": "#8a8a8a",
    "oracle": "#7b4fd6",
    "soft": "#117733",
}
OTHER_COLOURS = ("#f781bf", "#7f9c00", "#1f3a93", "#17becf", "#843c39", "#c49c00", "#3b7a57", "#b39ddb",
                 "#ff7f0e")

# Of every page, those of the doctor too.
BASIC_STYLE = """
body { font-family: sans-serif; color: #222; max-width: 75em; margin: 2em auto; padding: 0 1em; }
h1 { font-size: 1.6em; } h2 { font-size: 1.25em; margin-top: 2em; border-bottom: 1px solid #ccc; }
table { border-collapse: collapse; margin: 1em 0; font-size: 0.92em; }
img { max-width: 100%; height: auto; }
"""
STYLE = BASIC_STYLE + """
table { display: block; overflow-x: auto; }
th, td { padding: 0.3em 0.8em; border-bottom: 1px solid #ddd; text-align: right; white-space: nowrap; }
th { border-bottom: 2px solid #888; vertical-align: bottom; white-space: normal; min-width: 3.2em; }
th:first-child, td:first-child { text-align: left; }
.swatch { display: inline-block; width: 0.8em; height: 0.8em; margin-right: 0.5em; border-radius: 2px; }
figure { margin: 1.5em 0; }
figcaption { color: #444; font-size: 0.92em; max-width: 60em; }
pre { background: #f5f5f5; padding: 0.8em; overflow-x: auto; font-size: 0.88em; }
"""


class ReportError(Exception):
    """The input does not allow a report; the message names the file and what is wrong with it."""


def run_main(make_report):
    """Call make_report(directory) with the one command line argument; exit 1 with one line on bad input."""
    program = os.path.splitext(os.path.basename(sys.argv[0]))[0]
    if len(sys.argv) != 2 or sys.argv[1] in ("-h", "--help"):
        asked = len(sys.argv) == 2
        print("usage: {} DIR   (DIR holds metrics.json and data/)".format(program),
              file=sys.stdout if asked else sys.stderr)
        sys.exit(0 if asked else 2)
    try:
        print(make_report(sys.argv[1].rstrip("/") or "/"))
    except ReportError as error:
        print("{}: {}".format(program, error), file=sys.stderr)
        sys.exit(1)


def read_json(path):
    """The object in the JSON file `path`."""
    try:
        with open(path, encoding="utf-8") as stream:
            content = json.load(stream)
    except OSError as error:
        raise ReportError("{}: {}".format(path, error.strerror))
    except ValueError as error:
        raise ReportError("{}: not valid JSON: {}".format(path, error))
    if not isinstance(content, dict):
        raise ReportError("{}: not a JSON object".format(path))
    return content


def require_object(content, key, path):
    """The non-empty object `key` of a metrics file."""
    value = content.get(key)
    if not isinstance(value, dict) or not value:
        raise ReportError("{}: missing object {}".format(path, key))
    return value


def read_csv(path, columns):
    """The structured array of a CSV file with a header; every name in `columns` must be there.

    A file with one row gives an array of length 1, one with only the header an array of length 0. Empty and
    unreadable cells are NaN.
    """
    try:
        with open(path, encoding="utf-8") as stream:
            header = [name.strip() for name in stream.readline().split(",")]
            has_rows = any(line.strip() for line in stream)
    except OSError as error:
        raise ReportError("{}: {}".format(path, error.strerror))
    for column in columns:
        if column not in header:
            raise ReportError("{}: missing column {}".format(path, column))
    if not has_rows:
        return np.empty(0, dtype=[(name, float) for name in header])
    try:
        rows = np.genfromtxt(path, delimiter=",", names=True, dtype=float, encoding="utf-8")
    except ValueError as error:
        raise ReportError("{}: {}".format(path, str(error).strip().splitlines()[-1].strip()))
    return np.atleast_1d(rows)


def read_optional_csv(path, columns):
    """As read_csv, but None when there is no such file."""
    return read_csv(path, columns) if os.path.exists(path) else None


def number(content, *keys):
    """The number at content[key][key]...; NaN when it is absent or null."""
    for key in keys:
        if not isinstance(content, dict) or content.get(key) is None:
            return float("nan")
        content = content[key]
    try:
        return float(content)
    except (TypeError, ValueError):
        return float("nan")


def finite(values):
    """The finite entries of an array."""
    values = np.asarray(values, dtype=float)
    return values[np.isfinite(values)]


def wrap_angle(angle_rad):
    """The angle in [-pi, pi)."""
    return (np.asarray(angle_rad) + np.pi) % (2.0 * np.pi) - np.pi


def line_degrees(angle_rad):
    """Angles for a line: wrapped, in degrees, NaN where it wraps, so that no line crosses the axes."""
    degrees = np.degrees(wrap_angle(angle_rad))
    degrees[1:][np.abs(np.diff(degrees)) > 180.0] = np.nan
    return degrees


def method_colours(names):
    """A colour for each method: the fixed one if known, otherwise the next free one in the given order."""
    colours = {name: METHOD_COLOURS[name] for name in names if name in METHOD_COLOURS}
    others = [name for name in names if name not in colours]
    for index, name in enumerate(others):
        colours[name] = OTHER_COLOURS[index % len(OTHER_COLOURS)]
    return colours


def lighter(colour):
    """The colour mixed with white."""
    return tuple(0.4 * part + 0.6 for part in to_rgb(colour))


def save_figure(figure, path):
    """Write the figure, and close it."""
    try:
        with whole_file(path, mode="wb") as stream:
            figure.savefig(stream, dpi=FIGURE_DPI, format="png", bbox_inches="tight", facecolor="white")
    except NotWritten as error:
        raise ReportError(str(error))
    finally:
        plt.close(figure)


def write_text(path, text):
    """Write a text file."""
    try:
        write_whole(path, text)
    except NotWritten as error:
        raise ReportError(str(error))


def legend_beside(axes, **options):
    """A legend to the right of the axes, where it hides nothing."""
    legend = axes.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), borderaxespad=0.0, frameon=False,
                         fontsize=9, **options)
    for line in legend.get_lines():
        line.set_linewidth(2.0)


def plain_ticks(axis, subs=(1.0,)):
    """Tick labels of a logarithmic axis as 0.1, 1, 10 instead of powers; with those of `subs` times a power of ten."""
    if len(subs) > 1:
        axis.set_major_locator(LogLocator(subs=subs))
    axis.set_major_formatter(FuncFormatter(lambda value, _: "{:g}".format(value)))


def light_grid(axes):
    """A grid that stays behind the data."""
    axes.grid(True, which="major", color="#dddddd", linewidth=0.6)
    axes.set_axisbelow(True)


def format_number(value, digits=2):
    """The number for a table; an en dash when there is none."""
    return "{:.{}f}".format(value, digits) if np.isfinite(value) else "\u2013"


def format_json(content):
    """Indented JSON with each list of plain values on one line."""
    text = json.dumps(content, indent=2, ensure_ascii=False)
    return re.sub(r"\[[^\[\]{}\"]*\]", lambda match: " ".join(match.group().split()), text)


def image_tag(png, name):
    """A picture within a page."""
    return '<img src="data:image/png;base64,{}" alt="{}">'.format(base64.b64encode(png).decode(),
                                                                 html.escape(name, quote=True))


class HtmlPage:
    """A page that needs no other file: its pictures are in it. All text is escaped."""

    def __init__(self, title, directory):
        """`directory` is that of the pictures."""
        self._directory = directory
        self._title = html.escape(title)
        self._parts = ["<h1>{}</h1>".format(self._title)]

    @staticmethod
    def _swatch(colour):
        return '<span class="swatch" style="background:{}"></span>'.format(colour) if colour else ""

    def heading(self, text):
        """Start a section."""
        self._parts.append("<h2>{}</h2>".format(html.escape(text)))

    def paragraph(self, text):
        """A paragraph of plain text."""
        self._parts.append("<p>{}</p>".format(html.escape(text)))

    def link(self, path, text):
        """To another file, from where this page lies."""
        self._parts.append('<p><a href="{}">{}</a></p>'.format(html.escape(path, quote=True), html.escape(text)))

    def table(self, header, rows, colours=None):
        """A table of strings; `colours` maps entries of the first column to the colour of their mark."""
        cells = "".join("<th>{}</th>".format(html.escape(name)) for name in header)
        lines = ["<table>", "<thead><tr>{}</tr></thead>".format(cells), "<tbody>"]
        for row in rows:
            first, rest = row[0], row[1:]
            cells = "<td>{}{}</td>".format(self._swatch((colours or {}).get(first)), html.escape(first))
            cells += "".join("<td>{}</td>".format(html.escape(cell)) for cell in rest)
            lines.append("<tr>{}</tr>".format(cells))
        self._parts.append("\n".join(lines + ["</tbody>", "</table>"]))

    def image(self, file_name, caption):
        """A PNG of the pictures' directory."""
        path = os.path.join(self._directory, file_name)
        try:
            with open(path, "rb") as stream:
                picture = image_tag(stream.read(), file_name)
        except OSError as error:
            raise ReportError("{}: {}".format(path, error.strerror))
        self._parts.append("<figure>{}\n<figcaption>{}</figcaption></figure>".format(picture, html.escape(caption)))

    def fragment(self, markup):
        """HTML as it is."""
        self._parts.append(markup)

    def listing(self, content):
        """Parameters or a command, as they are; anything but a string is written as JSON."""
        text = content if isinstance(content, str) else format_json(content)
        self._parts.append("<pre>{}</pre>".format(html.escape(text)))

    def provenance(self, metrics, without):
        """How the numbers were made: command, machine and the other entries of `metrics` but `without`."""
        self.heading("How this was made")
        for key in ("command", "machine"):
            if metrics.get(key):
                self.paragraph(key.capitalize() + ":")
                self.listing(metrics[key])
        rest = {key: value for key, value in metrics.items()
                if key not in ("command", "machine") and key not in without}
        if rest:
            self.paragraph("Conditions:")
            self.listing(rest)

    def save(self, path):
        """Write the page."""
        page = ['<!DOCTYPE html>', '<html lang="en">', '<head>', '<meta charset="utf-8">',
                "<title>{}</title>".format(self._title), "<style>{}</style>".format(STYLE), "</head>",
                "<body>"]
        write_text(path, "\n".join(page + self._parts + ["</body>", "</html>", ""]))
