"""What occlusion_report.py draws of a recording: replay --occlusion with each model, and what the bags then hold.

With a ground truth (poses, a simulator's lines of sight) in the recording the errors of fixes and trajectories are
there, without it only what the models say of the fixes and the map of the satellites.
"""

import json
import os
import sys

import numpy as np
import rosbag

import report_common as common
from package_programs import program
from recordings import call

# Runs, by name: what tells replay to weigh fixes so.
MODELS = {name: ("--set", "occlusion.model=" + name) for name in ("conventional", "paper", "soft")}
# Table II is of a Gaussian UKF that believes the models, also where they are below the receiver's claim.
FILTER = ("--localizer", "ukf", "--set", "outliers=none", "--set", "occlusion.expert.covariance.allow_smaller=true")
BAD_FIX_M = 6.0
BLOCKED_SHARE = 0.5   # of the rays to a satellite, from which the map blocks it
GAP_S = 1.0           # between truths that are interpolated
SERIES_STEP_S = 0.2   # of the trajectories that are drawn
EQUATOR_M, ECCENTRICITY_2 = 6378137.0, 6.69437999014e-3  # WGS 84
NAN = float("nan")


class Recording:
    """The messages of a bag by their topics' names, with or without a leading slash."""

    def __init__(self, path):
        self.path = path
        try:
            self.bag = rosbag.Bag(path)
        except Exception as error:  # rosbag lets those of struct and others through where a file is damaged
            raise common.ReportError("{}: cannot be read as a bag: {}".format(path, error))
        self.topics = sorted(self.bag.get_type_and_topic_info().topics)

    def messages(self, name):
        """Those of the topic called so."""
        found = [topic for topic in self.topics if topic.lstrip("/") == name.lstrip("/")]
        for _, message, _ in self.bag.read_messages(found) if found else ():
            yield message

    def need(self, name):
        """The same, as a list; an error where there are none."""
        found = list(self.messages(name))
        if not found:
            raise common.ReportError("{} has no message on {}; it has {}".format(self.path, name,
                                                                                 ", ".join(self.topics)))
        return found


def stamp_of(message):
    """ns, as an integer: the same in every bag."""
    return message.header.stamp.to_nsec()


def yaw_of(q):
    """Of a quaternion, rad."""
    return np.arctan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y * q.y + q.z * q.z))


def trajectory_of(messages):
    """Rows t (ns), x, y, yaw of nav_msgs/Odometry, in the order of the stamps."""
    rows = {stamp_of(m): (m.pose.pose.position.x, m.pose.pose.position.y, yaw_of(m.pose.pose.orientation))
            for m in messages}
    return np.array([(t,) + rows[t] for t in sorted(rows)], dtype=float).reshape(-1, 4)


def interpolate(trajectory, stamps):
    """Poses x, y, yaw at the stamps; NaN outside of the trajectory and in its gaps."""
    stamps = np.asarray(stamps, dtype=float)
    if len(trajectory) < 2:
        return np.full((len(stamps), 3), NAN)
    t = trajectory[:, 0]
    columns = [trajectory[:, 1], trajectory[:, 2], np.unwrap(trajectory[:, 3])]
    poses = np.column_stack([np.interp(stamps, t, column, NAN, NAN) for column in columns])
    after = np.clip(np.searchsorted(t, stamps), 1, len(t) - 1)
    poses[t[after] - t[after - 1] > 1e9 * GAP_S] = NAN
    return poses


def to_local(datum, places):
    """East and north (m) of places (deg, deg, m) in the plane that touches the ellipsoid at the datum."""
    def to_cartesian(latitude, longitude, height):
        normal = EQUATOR_M / np.sqrt(1.0 - ECCENTRICITY_2 * np.sin(latitude) ** 2)
        return np.array([(normal + height) * np.cos(latitude) * np.cos(longitude),
                         (normal + height) * np.cos(latitude) * np.sin(longitude),
                         (normal * (1.0 - ECCENTRICITY_2) + height) * np.sin(latitude)])
    places = np.asarray(places, dtype=float).reshape(-1, 3)
    latitude, longitude = np.radians(datum[:2])
    offset = (to_cartesian(np.radians(places[:, 0]), np.radians(places[:, 1]), np.nan_to_num(places[:, 2])) -
              to_cartesian(latitude, longitude, datum[2])[:, np.newaxis])
    east = np.array([-np.sin(longitude), np.cos(longitude), 0.0])
    north = np.array([-np.sin(latitude) * np.cos(longitude), -np.sin(latitude) * np.sin(longitude), np.cos(latitude)])
    return np.column_stack([east @ offset, north @ offset])


class Run:
    """What one model made of the recording."""

    def __init__(self, recording):
        self.visibilities = {stamp_of(m): m for m in recording.need("gps/visibility")}
        self.fixes = {stamp_of(m): m for m in recording.need("gps/fix_weighted")}
        estimates = recording.need("odometry/filtered")
        self.estimate = trajectory_of(estimates)
        self.base_frame = estimates[0].child_frame_id.lstrip("/")

    def stamps(self):
        """Of the fixes that were weighed."""
        return sorted(set(self.visibilities) & set(self.fixes))

    def covariances(self, stamps, name):
        """2x2 matrices, m^2; NaN where there is none."""
        matrices = np.array([getattr(self.visibilities[t], name) for t in stamps], dtype=float).reshape(-1, 2, 2)
        matrices[np.trace(matrices, axis1=1, axis2=2) <= 0.0] = NAN
        return matrices

    def is_good(self, stamps):
        """The model's classification."""
        return np.array([self.visibilities[t].good for t in stamps], dtype=bool)

    def satellites(self):
        """Rows blocked share, known share, C/N0 of every satellite that the map judged, with stamp and identity."""
        for stamp, visibility in sorted(self.visibilities.items()):
            for s in visibility.satellites:
                if s.visibility != s.NOT_USED and np.isfinite(s.blocked_fraction):
                    yield (stamp, s.constellation, s.svid), (s.blocked_fraction, s.known_fraction, s.cn0)


class Truth:
    """What the recording knows better than any receiver; each part may be missing."""

    def __init__(self, recording, topic, datum):
        """`datum`: that of the runs (deg, deg, m); the poses of the recording are about its own gps/datum."""
        self.poses = trajectory_of(recording.messages(topic))
        for message in recording.messages("gps/datum"):
            self.poses[:, 1:3] += to_local(datum, (message.latitude, message.longitude, message.altitude))
            break
        self.errors = {stamp_of(m): (m.vector.x, m.vector.y)
                       for m in recording.messages("ground_truth/gps_error")}
        self.lines_of_sight = {(stamp_of(m), path.constellation, path.svid): path.line_of_sight
                               for m in recording.messages("ground_truth/signal_paths") for path in m.paths}
        self.antennas = {(t.header.frame_id.lstrip("/"), t.child_frame_id.lstrip("/")): t.transform.translation
                         for m in recording.messages("tf_static") for t in m.transforms}

    def fix_errors(self, run, stamps, places):
        """East and north, m: the simulator's, or else against the truth at the antenna's place."""
        poses = interpolate(self.poses, stamps)
        errors = np.full((len(stamps), 2), NAN)
        for k, (stamp, (x, y, yaw)) in enumerate(zip(stamps, poses)):
            frame = run.fixes[stamp].header.frame_id.lstrip("/")
            lever = self.antennas.get((run.base_frame, frame))
            lx, ly = (lever.x, lever.y) if lever else (0.0, 0.0)
            antenna = (x + lx * np.cos(yaw) - ly * np.sin(yaw), y + lx * np.sin(yaw) + ly * np.cos(yaw))
            errors[k] = self.errors.get(stamp, places[k] - antenna)
        return errors


def summary(values):
    """Mean, standard deviation and greatest of the finite ones; None where there are none."""
    values = common.finite(values)
    if not len(values):
        return None, None, None
    return float(np.mean(values)), float(np.std(values)), float(np.max(values))


def trajectory_metrics(truth, estimate):
    """A row of Table II."""
    poses = interpolate(estimate, truth[:, 0])
    position = np.hypot(poses[:, 0] - truth[:, 1], poses[:, 1] - truth[:, 2])
    heading = np.abs(common.wrap_angle(poses[:, 2] - truth[:, 3]))
    p, h = summary(position), summary(heading)
    return {"position_mean_m": p[0], "position_sigma_m": p[1], "position_max_m": p[2], "heading_mean_rad": h[0],
            "heading_sigma_rad": h[1], "coverage": float(np.mean(np.isfinite(position)))}


def odometry_alone(truth, odometry, start):
    """The odometry's trajectory from the true pose at `start` (ns) on, in the truth's frame."""
    true, told = interpolate(truth, [start])[0], interpolate(odometry, [start])[0]
    if not np.isfinite([*true, *told]).all():
        return np.empty((0, 4))
    turn = true[2] - told[2]
    rows = odometry[odometry[:, 0] >= start].copy()
    dx, dy = rows[:, 1] - told[0], rows[:, 2] - told[1]
    rows[:, 1] = true[0] + dx * np.cos(turn) - dy * np.sin(turn)
    rows[:, 2] = true[1] + dx * np.sin(turn) + dy * np.cos(turn)
    rows[:, 3] += turn
    return rows


def classification(is_good, errors):
    """Table I of one model; nothing without the errors."""
    known = np.isfinite(errors)
    good, called = errors[known] <= BAD_FIX_M, is_good[known]
    if not len(good):
        return None
    return {"good_called_good": int(np.sum(good & called)), "good_called_bad": int(np.sum(good & ~called)),
            "bad_called_good": int(np.sum(~good & called)), "bad_called_bad": int(np.sum(~good & ~called)),
            "correct": float(np.mean(good == called))}


def mean_nees(errors, covariances):
    """Mean of the errors' squares over the covariances; None where there is none."""
    known = np.isfinite(errors).all(axis=1) & np.isfinite(covariances).all(axis=(1, 2))
    values = np.einsum("ki,kij,kj->k", errors[known], np.linalg.inv(covariances[known]), errors[known])
    return summary(values)[0]


def verdict_metrics(run, stamps):
    """What a model says of the fixes, of which no truth is needed."""
    sigma = np.sqrt(np.trace(run.covariances(stamps, "weighted_covariance"), axis1=1, axis2=2))
    known = common.finite(sigma)
    visibilities = [run.visibilities[t] for t in stamps]
    return {"fixes": len(stamps), "bad": float(np.mean(~run.is_good(stamps))),
            "with_map": float(np.mean([v.source in (v.SOURCE_LIDAR, v.SOURCE_LIDAR_AND_SATELLITES)
                                       for v in visibilities])),
            "sigma_median_m": float(np.median(known)) if len(known) else None,
            "sigma_p95_m": float(np.percentile(known, 95.0)) if len(known) else None}


def satellite_metrics(run, lines_of_sight):
    """What the map says of the satellites, and how that agrees with C/N0 and with the true line of sight."""
    judged = list(run.satellites())
    if not judged:
        return {"judged": 0}
    values = np.array([row for _, row in judged])
    blocked = values[:, 0] >= BLOCKED_SHARE
    truth = np.array([lines_of_sight.get(key, NAN) for key, _ in judged], dtype=float)

    def share(of, among):
        return float(np.mean(of[among])) if among.any() else None
    return {"judged": len(judged), "blocked": float(np.mean(blocked)), "known": float(np.mean(values[:, 1])),
            "cn0_free_dbhz": summary(values[~blocked, 2])[0], "cn0_blocked_dbhz": summary(values[blocked, 2])[0],
            "direct_called_free": share(~blocked, truth == 1.0), "hidden_called_blocked": share(blocked, truth == 0.0)}


def write_rows(path, header, rows):
    """A CSV file of numbers."""
    values = np.asarray(rows, dtype=float).reshape(-1, len(header))
    common.write_text(path, "\n".join([",".join(header)] + [",".join("%.6g" % cell for cell in row) for row in values])
                      + "\n")


def write_trajectory(path, trajectory, start):
    """t (s since start), x, y, yaw, not too many."""
    kept, last = [], -np.inf
    for row in trajectory:
        t = 1e-9 * (row[0] - start)
        if t - last >= SERIES_STEP_S:
            kept.append((t, *row[1:]))
            last = t
    write_rows(path, ("t", "x", "y", "yaw"), kept)


def replay_models(out, options):
    """Run the recording once with each model, into OUT/runs."""
    folder = os.path.join(out, "runs")
    os.makedirs(folder, exist_ok=True)
    for done, (name, settings) in enumerate(MODELS.items(), 1):
        print("{}/{} replay --occlusion, {}".format(done, len(MODELS), name), file=sys.stderr)
        stem = os.path.join(folder, name)
        call(*program("replay"), options.bag, "--occlusion", "--odom-topic", options.odom_topic, "--truth-topic",
             options.truth_topic, *FILTER, *settings, *options.arguments, "--output", stem + ".bag", "--json",
             stem + ".json")


def replayed_runs(out):
    """What replay_models() left in OUT: the bags by model, and the datum (deg, deg, m)."""
    folder = os.path.join(out, "runs")
    paths = {name: os.path.join(folder, name + ".bag") for name in MODELS
             if os.path.exists(os.path.join(folder, name + ".bag"))}
    if not paths:
        raise common.ReportError("{}: no bag of a run; leave out --no-run".format(folder))
    return paths, common.read_json(os.path.join(folder, next(iter(paths)) + ".json"))["datum"]


def recorded_run(bag):
    """A bag of the live graph: its own weighed fixes as the only run."""
    recording = Recording(bag)
    model = recording.need("gps/visibility")[0].model
    datum = recording.need("gps/datum")[0]
    return {model: bag}, (datum.latitude, datum.longitude, datum.altitude)


def metrics_of(runs, truth, stamps, errors, odometry):
    """The metrics of the recording, of which the parts that need a truth may be missing; and the trajectories."""
    first = next(iter(runs.values()))
    trajectories = {"odometry": odometry_alone(truth.poses, odometry, first.estimate[0, 0])}
    trajectories.update({model: run.estimate for model, run in runs.items()})
    content = {"fixes": {model: verdict_metrics(run, stamps) for model, run in runs.items()},
               "satellites_of": {model: satellite_metrics(run, truth.lines_of_sight) for model, run in runs.items()}}
    if np.isfinite(errors).any():
        sizes = np.hypot(errors[:, 0], errors[:, 1])
        content["classification"] = {model: classification(run.is_good(stamps), sizes) for model, run in runs.items()}
        covariances = {model: run.covariances(stamps, "weighted_covariance") for model, run in runs.items()}
        covariances["claimed"] = first.covariances(stamps, "claimed_covariance")
        content["fix_nees"] = {key: {"mean": mean_nees(errors, value)} for key, value in covariances.items()}
    if len(truth.poses):
        content["trajectory"] = {key: trajectory_metrics(truth.poses, value) for key, value in trajectories.items()}
    return content, trajectories


def write_fixes(path, runs, models, stamps, start, places, errors):
    """The fixes with what each model says of them; without numbers where a model has no run."""
    def sigma(run, name):
        return np.sqrt(np.trace(run.covariances(stamps, name), axis1=1, axis2=2))
    columns = {"t": 1e-9 * (np.array(stamps) - start), "x": places[:, 0], "y": places[:, 1],
               "error": np.hypot(errors[:, 0], errors[:, 1]),
               "sigma_claimed": sigma(next(iter(runs.values())), "claimed_covariance")}
    for model in dict.fromkeys((*models, *runs)):
        run = runs.get(model)
        columns["sigma_" + model] = sigma(run, "weighted_covariance") if run else np.full(len(stamps), NAN)
        columns["good_" + model] = run.is_good(stamps) if run else np.full(len(stamps), NAN)
    write_rows(path, tuple(columns), np.column_stack(list(columns.values())))


def write_metrics(out, paths, datum, models, options):
    """OUT/metrics.json and OUT/data, as occlusion_experiment writes them."""
    recording = Recording(options.bag)
    runs = {model: Run(Recording(path)) for model, path in paths.items()}
    truth = Truth(recording, options.truth_topic, datum)
    stamps = sorted(set.intersection(*(set(run.stamps()) for run in runs.values())))
    if not stamps:
        raise common.ReportError("{}: no fix was weighed".format(options.bag))
    first = next(iter(runs.values()))
    places = to_local(datum, [(f.latitude, f.longitude, f.altitude) for f in (first.fixes[t] for t in stamps)])
    errors = truth.fix_errors(first, stamps, places)
    odometry = trajectory_of(recording.messages(options.odom_topic))
    content, trajectories = metrics_of(runs, truth, stamps, errors, odometry)

    name = os.path.splitext(os.path.basename(options.bag))[0]
    start = min(stamps[0], *(run.estimate[0, 0] for run in runs.values()))
    data = os.path.join(out, "data")
    os.makedirs(data, exist_ok=True)
    write_fixes(os.path.join(data, "fixes_{}.csv".format(name)), runs, models, stamps, start, places, errors)
    for key in dict.fromkeys(("truth", *models, *trajectories)):
        trajectory = truth.poses if key == "truth" else trajectories.get(key, np.empty((0, 4)))
        write_trajectory(os.path.join(data, "trajectory_{}_{}.csv".format(name, key)), trajectory, start)
    command = "rosrun urban_gnss_localization occlusion_report.py " + " ".join(sys.argv[1:])
    metrics = {"command": command, "bag": os.path.basename(options.bag), "scenarios": {name: content}}
    common.write_text(os.path.join(out, "metrics.json"), json.dumps(metrics, indent=2))


def prepare(out, models, options):
    """All that the report of a bag needs, in OUT, with columns for these models."""
    os.makedirs(out, exist_ok=True)
    if options.recorded:
        paths, datum = recorded_run(options.bag)
    else:
        if not options.no_run:
            replay_models(out, options)
        paths, datum = replayed_runs(out)
    write_metrics(out, paths, datum, models, options)
