# SPDX-License-Identifier: Apache-2.0
"""Ball, cup and box seen by imperfect, calibrated cameras: errors of their positions, their covariances, and false objects.

Claim: a robot that has calibrated its cameras by looking at its own hand places ball, cup and box within millimetres, reports correct
covariances of their positions, and reports no object where there is none.
Source: thesis 4.3.3, in which seen objects are put into the world model; it has no numbers.  Aims of this reproduction: over random gazes
and places the error is at most 5 mm (median) and 15 mm (95 %); the squared error, normalised by the reported covariance, is below the 95 %
quantile of its distribution for 90 to 98 % of the places; and no false object is reported in 10 minutes, at 15 pictures a second, in front
of a table without these three things, on which some sheets of paper have their colours.

A trial draws the errors of one robot's cameras and calibrates them with 40 postures of its hand.  Then it shows ball, cup and box side by
side in random places, each thing upright and with a random angle, and takes one picture with each camera; things that are hidden by another
thing or an arm may be missed.  All pictures are rendered with distortion, noise and motion blur, in a cluttered room.  For the last claim
the things are taken away, and the head looks around: 15 pairs of pictures with each of many random gazes, from which the tracker reports
objects as in the live system.  Run time: five minutes a robot on one core.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence
from time import process_time
from typing import Any

import numpy as np

from experiments.claims.ch4_vision.hand_eye_calibration import (
    ENCODER,
    HONEST,
    MEDIAN,
    MOST,
    POSTURES,
    QUICK_POSTURES,
    READINGS,
    random_gaze,
    rig,
)
from experiments.kit.command_line import positive_whole
from experiments.kit.experiment import OUR_AIM, Experiment, Measured, claim, judged
from experiments.kit.plots import finish, finish_normalised, new_figure
from experiments.kit.rules import all_hold, decides
from experiments.kit.statistics import chi_squared, estimate, interval
from experiments.kit.sweep import Cells, Condition, Sweep, grouped
from mobee.arrays import Array
from mobee.model.model import Model
from mobee.model.world_file import load_world
from mobee.rendering.scene import Scene, clutter, room
from mobee.vision.calibration.calibration import Calibration
from mobee.vision.calibration.observing import Watcher, choose_postures, watch_hand
from mobee.vision.calibration.solve import calibrate
from mobee.vision.encoders import Moment
from mobee.vision.imperfections import CameraErrors, Cameras, CameraSettings, camera_errors
from mobee.vision.objects.detectors import detector_of
from mobee.vision.objects.placing import Eyes, Placed, eyes_at, locate_all
from mobee.vision.objects.thing import Thing, things_in
from mobee.vision.objects.track import Tracker

GAZES, LOOKS = 100, 1800  # with the things; pictures without them: 10 minutes at 15 Hz of five robots
QUICK_GAZES, QUICK_LOOKS = 6, 45
LOOKS_A_GAZE, RATE = 15, 15.0  # Hz
AWAY = np.array([3.0, 0.0, 3.0])  # m: behind the robot
APART, ASIDE = 0.09, 0.12  # m between the middles of two things, at least; and from the middle of the gaze, at most
FALSE = 0.05  # m: a thing that is placed farther from where it is was taken for something else
KINDS = ("ball", "cup", "box")
COLOR = "color"
DETECTOR_FIELDS = {  # which records of older runs do not have
    "false_regions": "regions detected in a picture without things",
    "detector_ms": "processor time of the detector, ms a picture",
}

Groups = Mapping[str, Sequence[Mapping[str, Any]]]


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the options --gazes, --looks and --detector to the parser."""
    parser.add_argument("--gazes", type=positive_whole, default=GAZES, metavar="N", help="gazes at the things (default: %(default)s)")
    parser.add_argument("--looks", type=positive_whole, default=LOOKS, metavar="N", help="pictures without things (default: %(default)s)")
    text = f"detector: {COLOR}, or a file of `mobee detector train` (default: %(default)s)"
    parser.add_argument("--detector", default=COLOR, metavar="FILE", help=text)


def conditions(arguments: argparse.Namespace) -> list[Condition]:
    """Return the only condition of the sweep: ball, cup and box on the table."""
    numbers = (QUICK_POSTURES, QUICK_GAZES, QUICK_LOOKS) if arguments.quick else (POSTURES, arguments.gazes, arguments.looks)
    settings = {"world": "things", "postures": numbers[0], "gazes": numbers[1], "looks": numbers[2]}
    if arguments.detector != COLOR:  # records from before there was a choice do not name it
        settings["detector"] = arguments.detector
    return [Condition("things", settings)]


class Robot:
    """A calibrated robot at its table, whose cameras look at things.

    `things`: the objects that it can recognise.  `pictures`: number of pictures so far.  `regions`: number of detected regions in these
    pictures.  `seconds`: processor time of the detector [s].

    Args:
        world: name of the world with the things.
        postures: number of postures of the hand for the calibration.
        seed: of camera errors, noise and gazes.
        detector: "color", or the file of a trained detector.
    """

    def __init__(self, world: str, postures: int, seed: int, detector: str = COLOR) -> None:
        self._settings, model = CameraSettings(samples=2), Model(rig().robot, load_world("table"))
        errors = camera_errors(self._settings, rig().robot, list(rig().cameras), seed)
        chosen = choose_postures(rig(), model, self._settings, "left_arm", postures, seed)
        hand = watch_hand(Watcher(rig(), model, self._settings, errors, seed), chosen, "left_arm")
        self._found: Calibration = calibrate(rig(), hand, self._settings)
        self._world, self._rng = load_world(world), np.random.default_rng([seed, 0x7468696E67])
        self.things = things_in(self._world)
        self._detect = detector_of(detector, self.things)
        self.pictures, self.regions, self.seconds = 0, 0, 0.0  # seen; detected in them; processor time of the detector
        self._solids = [item for item in self._world.objects.values() if item.role == "obstacle"]
        self._scene, self._cameras = self._drawn(errors, seed)

    def _drawn(self, errors: CameraErrors, seed: int) -> tuple[Scene, Cameras]:
        colors = tuple(thing.color for thing in self.things)
        around = [*room(seed, colors), *clutter(self._world.objects.values(), seed, colors)]
        scene = Scene(rig().robot, self._world, rig().cameras, around=around)
        return scene, Cameras(scene, self._settings, errors, seed)

    def gaze(self) -> tuple[Array, Array]:
        """Return a random posture (n,) rad, and a position (3,) m, root frame, that both cameras see in this posture."""
        return random_gaze(self._rng)

    def put(self, name: str, position: Array, yaw: float) -> None:
        """Put a thing upright at a position (3,) m, root frame.  `yaw`: its angle about the vertical axis [rad]."""
        self._scene.place(name, position, np.array([np.cos(0.5 * yaw), 0.0, 0.0, np.sin(0.5 * yaw)]))

    def arrange(self, about: Array) -> dict[str, tuple[Array, float]]:
        """Put all things side by side around a position `about` (3,) m, root frame, at the height of the table or above it.

        Returns a dict from the name of each thing to its position (3,) m and angle [rad].
        """
        found: dict[str, tuple[Array, float]] = {}
        top = max(item.position[2] + 0.5 * item.size[2] for item in self._solids)
        for thing in self.things:
            half = thing.size[0] if thing.kind == "sphere" else 0.5 * thing.size[-1]
            at = about
            while at is about or any(np.linalg.norm((at - other)[:2]) < APART for other, _ in found.values()):
                at = about + np.array([*self._rng.uniform(-ASIDE, ASIDE, 2), 0.0])
            at[2] = max(about[2], top + half)
            found[thing.name] = at, float(self._rng.uniform(-np.pi, np.pi))
            self.put(thing.name, *found[thing.name])
        return found

    def look(self, q: Array) -> tuple[Eyes, list[Placed]]:
        """Take pictures in a posture `q` (n,) rad.

        Returns the poses of the cameras that the robot computes from its encoders and its calibration, and the things that it sees.
        """
        noise = ENCODER / np.sqrt(READINGS)
        moment = Moment(q + noise * self._rng.standard_normal(len(q)), np.zeros(len(q)), np.full(len(q), noise**2))
        eyes = eyes_at(rig(), self._found.x, moment, self._found.covariance, self._settings.jitter)
        pictures = {name: self._cameras.expose(name, [q] * self._settings.samples) for name in rig().cameras}
        begin = process_time()
        detections = {name: self._detect(one) for name, one in pictures.items()}
        self.seconds += process_time() - begin
        self.pictures += len(pictures)
        self.regions += sum(map(len, detections.values()))
        return eyes, locate_all(self.things, detections, eyes, self._solids)


def trial(settings: dict[str, Any], seed: int) -> dict[str, Any]:
    """Calibrate one robot, show it ball, cup and box, and then an empty table.

    For each thing NAME whose position was computed N times, at most 5 cm from the true one: "NAME_error" (N,) m, distance from its true
    position; "NAME_normalised" (N,), squared error, normalised by the covariance that the robot computes; "NAME_size" (N, g), relative
    errors of its g sizes (radius, height or edges).  "box_angle" (N,) rad: error of the box's angle.  Counts: "shown", gazes at things;
    "taken_for_another", reported positions more than 5 cm from the true one; "looks", pairs of pictures of the empty table;
    "false_objects", objects that the tracker reported there, and "false_places", positions that were computed from single pairs of these
    pictures, without the tracker.  "false_regions": regions per picture detected there.  "detector_ms": processor time per picture [ms].
    `settings`: "world", its name; numbers of "postures" of the calibration, of "gazes" at things, and of "looks" at the empty table;
    "detector", its name (optional).  `seed`: of everything random.
    """
    robot = Robot(settings["world"], settings["postures"], seed, settings.get("detector", COLOR))
    return {**_with_things(robot, settings["gazes"]), **_without(robot, settings["looks"])}


def _with_things(robot: Robot, gazes: int) -> dict[str, Any]:
    """Show the things in `gazes` random postures, and return the part of the result of `trial` that is about them.

    Its keys are "NAME_error", "NAME_normalised" and "NAME_size" for each thing NAME, "box_angle", "shown" and "taken_for_another"; see
    `trial` for their shapes and units.
    """
    rows: dict[str, list[tuple[float, float, Array]]] = {name: [] for name in KINDS}
    angles: list[float] = []
    wrong = 0
    things: dict[str, Thing] = {thing.name: thing for thing in robot.things}
    for _ in range(gazes):
        q, about = robot.gaze()
        places = robot.arrange(about)
        for one in robot.look(q)[1]:
            at, yaw = places[one.name]
            error = one.position - at
            if np.linalg.norm(error) > FALSE:
                wrong += 1
                continue
            normalised = float(error @ np.linalg.solve(one.covariance, error))
            rows[one.name].append((float(np.linalg.norm(error)), normalised, one.size / np.array(things[one.name].size) - 1.0))
            if one.name == "box":
                off = float(np.arctan2(one.rotation[1, 0], one.rotation[0, 0])) - yaw
                angles.append(abs((off + 0.25 * np.pi) % (0.5 * np.pi) - 0.25 * np.pi))
    found: dict[str, Any] = {"shown": gazes, "taken_for_another": wrong, "box_angle": np.array(angles)}
    for name, some in rows.items():
        found[f"{name}_error"] = np.array([row[0] for row in some])
        found[f"{name}_normalised"] = np.array([row[1] for row in some])
        found[f"{name}_size"] = np.array([row[2] for row in some])
    return found


def _without(robot: Robot, looks: int) -> dict[str, Any]:
    """Take `looks` pairs of pictures of the empty table, and return the part of the result of `trial` that is about them.

    Keys: "looks"; "false_objects", number of objects that the tracker reported; "false_places", number of positions computed from single
    pairs; "false_regions", number of detected regions per picture; "detector_ms", processor time per picture of all pictures so far [ms].
    """
    for thing in robot.things:
        robot.put(thing.name, AWAY, 0.0)
    tracker, names, single = Tracker(robot.things), set[str](), 0
    pictures, regions = robot.pictures, robot.regions
    gaze: Array | None = None
    q = robot.gaze()[0]
    for look in range(looks):
        if look % LOOKS_A_GAZE == 0:
            q = robot.gaze()[0]
        eyes, found = robot.look(q)
        single += len(found)
        turned = 0.0 if gaze is None else float(np.arccos(np.clip(0.5 * (np.trace(gaze.T @ eyes.eyes[0].rotation) - 1.0), -1.0, 1.0)))
        gaze = eyes.eyes[0].rotation
        tracker.update((look + 1) / RATE, found, turned)
        names |= {f"{track.name} {track.born:.3f}" for track in tracker.tracks}
    return {
        "looks": looks,
        "false_objects": len(names),
        "false_places": single,
        "false_regions": (robot.regions - regions) / (robot.pictures - pictures),
        "detector_ms": 1e3 * robot.seconds / robot.pictures,
    }


def _quantiles(groups: Groups, share: float) -> list[float]:
    """Return a quantile of the errors of all things, for each robot, mm."""
    return [1e3 * float(np.quantile(np.concatenate([run[f"{name}_error"] for name in KINDS]), share)) for run in groups["things"]]


@claim(
    OUR_AIM,
    "after the calibration ball, cup and box are placed within 5 mm (median) and 15 mm (95 %) over random gazes and places",
    f"{MEDIAN:g} and {MOST:g} mm",
)
def accuracy(groups: Groups) -> Measured:
    half, most = _quantiles(groups, 0.5), _quantiles(groups, 0.95)
    text = f"median {estimate(half, 1)} mm, 95 % {estimate(most, 1)} mm"
    return text, all_hold([decides(interval(half), most=MEDIAN), decides(interval(most), most=MOST)])


@claim(
    OUR_AIM,
    "the reported covariance of ball, cup and box is honest: the normalised error is within its 95 % band for 90 to 98 % of the places",
    "90 to 98 %",
)
def honest(groups: Groups) -> Measured:
    band = chi_squared(0.95, 3)
    shares = [float(np.mean(np.concatenate([run[f"{name}_normalised"] for name in KINDS]) <= band)) for run in groups["things"]]
    return f"share {estimate(shares, 3)}", decides(interval(shares), *HONEST)


@claim(OUR_AIM, "no false object is reported in 10 minutes before an empty, cluttered table", "0")
def nothing_false(groups: Groups) -> Measured:
    objects, looks = (sum(int(run[field]) for run in groups["things"]) for field in ("false_objects", "looks"))
    enough = looks >= 600 * RATE
    text = f"{objects} in {looks} pairs of pictures, {looks / RATE / 60.0:.1f} min at {RATE:g} Hz"
    return text, False if objects else True if enough else None


CLAIMS = (accuracy, honest, nothing_false)


def findings(found: Cells) -> dict[str, Any]:
    """Return the results of the sweep.

    Keys: "runs", a dict from each finished cell (one simulated robot) to its numbers, such as "found, share" and the errors in mm of each
    kind of object; "claims", a list with the judged claims, as dicts (`Claim.record`).  The claims are judged only by runs with the
    detector "color".
    """
    groups = grouped({name: cell for name, cell in found.items() if "detector" not in cell.cell.settings}, "world", ("things",))
    return {"runs": {name: _row(cell.values) for name, cell in found.items()}, "claims": judged(CLAIMS, groups, bool(groups))}


def _row(run: Mapping[str, Any]) -> dict[str, Any]:
    band = chi_squared(0.95, 3)
    each: list[tuple[str, Callable[[str], float]]] = [
        ("found, share", lambda name: len(run[f"{name}_error"]) / run["shown"]),
        ("median mm", lambda name: 1e3 * float(np.median(run[f"{name}_error"]))),
        ("95 % mm", lambda name: 1e3 * float(np.quantile(run[f"{name}_error"], 0.95))),
        ("within the 95 % band", lambda name: float(np.mean(np.asarray(run[f"{name}_normalised"]) <= band))),
        ("size, rms %", lambda name: 1e2 * float(np.sqrt(np.mean(np.square(run[f"{name}_size"]))))),
    ]
    numbers = {f"{name}: {label}": round(number(name), 3) for name in KINDS if len(run[f"{name}_error"]) for label, number in each}
    angles = np.rad2deg(np.asarray(run["box_angle"]))
    return {
        **numbers,
        "box: angle, median deg": round(float(np.median(angles)), 2) if len(angles) else None,
        "taken for something else": run["taken_for_another"],
        "false objects": run["false_objects"],
        "false places": run["false_places"],
        "pairs of pictures without things": run["looks"],
        **{label: round(float(run[field]), 2) for field, label in DETECTOR_FIELDS.items() if field in run},
    }


def plot(found: Cells) -> Any:
    """Return a figure of the distributions of the position errors and of the normalised errors of each thing.

    The normalised error is the squared position error, normalised by the covariance that the robot computes.  It is drawn beside the
    distribution that it has if the covariance is correct, chi-squared with 3 degrees of freedom.
    """
    runs = grouped(found, "world", ("things",))["things"]
    drawing = new_figure(9.0, 3.6)
    left, right = drawing.subplots(1, 2)
    shares = np.linspace(0.0, 1.0, 400)
    for color, name in zip(("C3", "C0", "C2"), KINDS, strict=True):
        errors, normalised = (np.concatenate([run[f"{name}_{field}"] for run in runs]) for field in ("error", "normalised"))
        left.plot(1e3 * np.quantile(errors, shares), shares, color=color, label=name)
        right.plot(np.quantile(normalised, shares), shares, color=color, label=name)
    for value, level in ((MEDIAN, 0.5), (MOST, 0.95)):
        left.plot([value], [level], "x", color="black", label="aim" if level == 0.5 else None)
    finish(left, xlabel="error of the position, mm", ylabel="share of the places", xscale="log", xlim=(0.3, 50.0))
    left.legend(fontsize=7, loc="lower right")
    finish_normalised(right)
    return drawing


EXPERIMENT = Experiment(
    claim="calibrated eyes place ball, cup and box within millimetres, with an honest covariance, and see nothing where nothing is",
    source=f"{OUR_AIM}; thesis 4.3.3",
    method=Sweep(conditions, trial, findings, plot, seeds=5, add_options=add_options),
    claims=CLAIMS,
)
