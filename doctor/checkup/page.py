"""The report as one HTML file, with its plots inside."""

import html
import io

import numpy as np
from report_common import BASIC_STYLE, image_tag, plt

from . import fits, signals
from .finding import family
from .text import FAMILIES, ordered_families, summary

DPI = 100
MOST_POINTS = 4000     # of a line
WIDTH_IN = 11.0        # of a figure: the page's
# Told apart by people who see colours differently, too (Okabe and Ito).
COLOURS = {"odometry": "#56b4e9", "imu": "#222222", "velocity": "#d55e00", "fix": "#d55e00"}
RATE_COLOURS = dict(COLOURS, velocity="#cc79a7", satellites="#009e73")  # of the receiver's streams, side by side
LEVEL_COLOURS = {"WARN": "#e6b800", "FAIL": "#c1121f"}
BIN_S = 5.0            # of the messages' rates
LEAST_SHOWN = 0.004    # of the whole time: the width of a shorter mark
STYLE = BASIC_STYLE + """
table { width: 100%; }
td { padding: 0.3em 0.6em; border-bottom: 1px solid #e4e4e4; vertical-align: top; }
td.level { font-weight: bold; width: 3.5em; }
code { display: block; color: #333; background: #f5f5f5; padding: 0.1em 0.4em; }
.PASS { color: #1a7f37; } .WARN { color: #9a6700; } .FAIL { color: #c1121f; }
img { width: 100%; }
"""


def thin(*columns):
    """At most MOST_POINTS of each."""
    step = max(1, len(columns[0]) // MOST_POINTS)
    return [column[::step] for column in columns]


def embedded(figure):
    """An image tag with the picture in it."""
    stream = io.BytesIO()
    figure.savefig(stream, dpi=DPI, format="png", bbox_inches="tight", facecolor="white")
    plt.close(figure)
    return image_tag(stream.getvalue(), "plot")


def plot_tracks(axes, evidence):
    """Fixes, and the odometry's track laid over them."""
    if evidence.fixes is not None:
        t, q, _ = evidence.fixes
        track = evidence.track()
        if track is not None and len(t) >= fits.LEAST_POINTS:
            inside = (t >= track.t[0]) & (t <= track.t[-1])
            if np.sum(inside) >= fits.LEAST_POINTS:
                p = track.place_at(t[inside])
                fitted = fits.fit(p, q[inside])
                laid = np.exp(1j * fitted.rotation) * p
                laid = laid + signals.median((q[inside] - laid).real) + 1j * signals.median((q[inside] - laid).imag)
                axes.plot(*thin(laid.real, laid.imag), color=COLOURS["odometry"], linewidth=3.0,
                          label="odometry alone, laid over the fixes: it drifts")
        axes.plot(*thin(q.real, q.imag), ".", color=COLOURS["fix"], markersize=2.5, label="fixes")
        low, high = np.percentile(q.real, [1, 99]), np.percentile(q.imag, [1, 99])
        margin = 0.2 * max(np.ptp(low), np.ptp(high), 5.0)
        axes.set_xlim(low[0] - margin, low[1] + margin)
        axes.set_ylim(high[0] - margin, high[1] + margin)
    elif evidence.track() is not None:
        track = evidence.track()
        axes.plot(*thin(track.place.real, track.place.imag), color=COLOURS["odometry"], label="odometry")
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("east [m]")
    axes.set_ylabel("north [m]")


def plot_speeds(axes, evidence, origin):
    """Speeds of odometry and receiver."""
    if evidence.motion is not None:
        t, velocity, _ = evidence.motion
        axes.plot(*thin(t - origin, velocity.real), color=COLOURS["odometry"], linewidth=1.6,
                  label="odometry, linear.x")
        top = 1.5 * np.percentile(np.abs(velocity), 99.5) + 0.5
        axes.set_ylim(min(0.0, 1.3 * np.min(velocity.real)) - 0.1, max(top, 1.0))
    if evidence.velocities is not None:
        t, velocity = evidence.velocities
        axes.plot(*thin(t - origin, np.abs(velocity)), ".", color=COLOURS["velocity"], markersize=2.0,
                  label="receiver's velocity")
    axes.set_ylabel("speed [m/s]")


def plot_rates(axes, evidence, origin):
    """Yaw rates of odometry and IMU."""
    if evidence.motion is not None:
        t, _, rate = evidence.motion
        axes.plot(*thin(t - origin, rate), color=COLOURS["odometry"], linewidth=1.6, label="odometry")
    if evidence.imu_rate is not None:
        t, rate = evidence.imu_rate
        axes.plot(*thin(t - origin, rate), color=COLOURS["imu"], linewidth=0.6, label="IMU")
    axes.set_ylabel("yaw rate [rad/s]")


def plot_message_rates(axes, recording):
    """Messages a second of each stream."""
    edges = bins(recording)
    top = 1.0
    streams = recording.streams()
    for index, stream in enumerate(streams):
        t = stream.received if stream.received.any() else stream.t
        rates = np.histogram(t, edges)[0] / (edges[1] - edges[0])
        axes.step(edges - recording.begin, np.append(rates, rates[-1]), where="post", label=stream.topic,
                  color=RATE_COLOURS[stream.kind], linewidth=1.2 * (len(streams) - index))
        top = max(top, np.max(rates))
    axes.set_yscale("symlog", linthresh=1.0)
    axes.set_yticks([0.0] + [10.0 ** power for power in range(int(np.ceil(np.log10(top))) + 1)])
    axes.yaxis.set_major_formatter("{x:g}")
    axes.set_ylim(-0.1, 2.0 * top)
    axes.set_ylabel("messages [1/s]")


def bins(recording):
    """Edges of bins of about BIN_S, all of the same width: the last one ends with the recording."""
    length = max(recording.duration(), 1e-3)
    return np.linspace(recording.begin, recording.begin + length, max(1, round(length / BIN_S)) + 1)


def timed(findings):
    """The findings that know when."""
    return [finding for finding in findings if finding.level in LEVEL_COLOURS and len(finding.values.get("spans", ()))]


def mark_times(all_axes, recording, findings):
    """When findings hold: a row of the last axes for each, with its name, and a shade over the others."""
    origin, least = recording.first_stamp(), LEAST_SHOWN * recording.duration()
    names = list(dict.fromkeys(finding.check for finding in findings))
    for finding in findings:
        colour = LEVEL_COLOURS[finding.level]
        spans = [(begin - origin, max(end - begin, least)) for begin, end in finding.values["spans"]]
        all_axes[-1].broken_barh(spans, (names.index(finding.check) - 0.3, 0.6), color=colour)
        for axes in all_axes[:-1]:
            for begin, width in spans:
                axes.axvspan(begin, begin + width, color=colour, alpha=0.25, linewidth=0.0)
    all_axes[-1].set_yticks(range(len(names)))
    all_axes[-1].set_yticklabels(names)
    all_axes[-1].set_ylim(len(names) - 0.5, -0.5)


def plots(evidence, findings):
    """The figures as image tags."""
    recording = evidence.recording
    parts = []
    figure, axes = plt.subplots(figsize=(WIDTH_IN, 6.5))
    plot_tracks(axes, evidence)
    finish(axes)
    parts.append(("Tracks", embedded(figure)))
    marked = timed(findings)
    heights = [1.0, 1.0, 1.0] + ([0.1 * (1 + len({finding.check for finding in marked}))] if marked else [])
    figure, all_axes = plt.subplots(len(heights), 1, figsize=(WIDTH_IN, 2.8 * sum(heights)), sharex=True,
                                    gridspec_kw={"height_ratios": heights, "hspace": 0.3})
    plot_speeds(all_axes[0], evidence, recording.first_stamp())
    plot_rates(all_axes[1], evidence, recording.first_stamp())
    plot_message_rates(all_axes[2], recording)
    if marked:
        mark_times(all_axes, recording, marked)
    all_axes[-1].set_xlim(0.0, max(recording.duration(), 1.0))
    all_axes[-1].set_xlabel("time [s]")
    for axes in all_axes:
        finish(axes)
    parts.append(("Speeds, yaw rates, messages" + (", times of findings" if marked else ""), embedded(figure)))
    return parts


def finish(axes):
    """Grid, and the legend above, where it hides nothing."""
    axes.grid(True, color="#dddddd", linewidth=0.6)
    axes.set_axisbelow(True)
    if axes.get_legend_handles_labels()[0]:
        axes.legend(fontsize=8, loc="lower right", bbox_to_anchor=(1.0, 1.0), ncol=5, frameon=False)


def table(findings):
    """A family's findings."""
    rows = []
    for finding in findings:
        changes = "".join("<code>{}</code>".format(html.escape(change)) for change in finding.change)
        rows.append('<tr><td class="level {0}">{0}</td><td>{1}: {2}{3}</td></tr>'.format(
            finding.level, html.escape(finding.check), html.escape(finding.text), changes))
    return "<table>{}</table>".format("\n".join(rows))


def page(evidence, findings):
    """The whole page as text."""
    recording = evidence.recording
    title = html.escape("doctor: " + recording.name)
    parts = ["<!DOCTYPE html>", '<html lang="en"><head><meta charset="utf-8">',
             "<title>{}</title><style>{}</style></head><body>".format(title, STYLE), "<h1>{}</h1>".format(title),
             "<p>{:.0f} s. {}</p>".format(recording.duration(), html.escape(summary(findings)))]
    bad = [finding for level in ("FAIL", "WARN") for finding in findings if finding.level == level]
    if bad:
        parts += ["<h2>What to change</h2>", table(bad)]
    for heading, image in plots(evidence, findings):
        parts += ["<h2>{}</h2>".format(heading), image]
    for name in ordered_families(findings):
        parts += ["<h2>{}</h2>".format(html.escape(FAMILIES.get(name, name))),
                  table([finding for finding in findings if family(finding) == name])]
    parts.append("<h2>All topics</h2><table>{}</table>".format("\n".join(
        "<tr><td>{}</td><td>{}</td><td>{}</td></tr>".format(html.escape(each.name), html.escape(each.type), each.count)
        for each in recording.topics)))
    return "\n".join(parts + ["</body></html>", ""])
