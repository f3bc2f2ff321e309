# SPDX-License-Identifier: Apache-2.0
"""Robots teaching robots: a Katana carries a ball to known positions, and the iCub learns to compute them from pictures (thesis 4.1.2).

Claim: a robot with uncalibrated cameras learns from another robot where things are.  Source: thesis 4.1.2 and Leitner et al. 2012 (doi
10.5772/54657: neural network and genetic programming, from the pixels in both cameras and the encoders, "in the centimetre range"; no
camera calibration and no kinematic model).  Aim of this reproduction: on held-out poses the learned localiser is at least three times
better than stereo by the uncalibrated cameras.

A trial draws the errors of one iCub's cameras and head encoders, as in hand-eye-calibration.  The Katana carries a red ball (the thesis: a
children's block) to random places 20 to 65 cm from the eyes; for each, the iCub looks from random postures of torso, head and eyes.  Both
move on the offline plant (simulation in one process) under one model, kept apart by the controller; pictures are rendered with distortion
and noise, in a room without clutter on the table.  The Katana reports the place by its own encoders.  A fifth of the Katana's poses is held
out: no localiser (method that computes the ball's position from both pictures and the encoders) learns from a picture of them.  The
localisers are compared with uncalibrated stereo, which uses the cameras of the model, and with stereo after a calibration of the cameras by
20 postures of the hand.  Errors are distances from the ball's true place; the error of a robot is its median.  Run time: about three
minutes a robot on one core.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any

import numpy as np

from experiments.kit.experiment import OUR_AIM, Experiment, Measured, claim, judged
from experiments.kit.plots import draw_band, finish, new_figure
from experiments.kit.rules import decides, ratio_within
from experiments.kit.statistics import estimate, interval
from experiments.kit.sweep import Cells, Condition, Sweep, grouped
from experiments.kit.two_robots import BALL, ICUB, KATANA, two_robots, watching
from mobee.arrays import Array, Ints
from mobee.model.model import Model
from mobee.model.world_file import load_world
from mobee.robot.cameras import cameras_of
from mobee.robot.load import load_robot
from mobee.vision.calibration.observing import Watcher, choose_postures, watch_hand
from mobee.vision.calibration.solve import calibrate
from mobee.vision.imperfections import CameraSettings, camera_errors
from mobee.vision.rig import Rig
from mobee.vision.tag import Tag
from mobee.vision.teaching.lessons import Lessons, split_by_pose, teacher_postures, watch_teacher
from mobee.vision.teaching.localisers import CORRECTED, REGRESSIONS, localiser, stereo_places

POSES, LOOKS, POSTURES = 120, 8, 20  # of the Katana; of the iCub for each; of the hand, for the calibration
QUICK = (8, 3, 12)
HELD_OUT = 0.2  # share of the Katana's poses
COUNTS = (50, 150, 400)  # lessons, of the learning curve, beside all of them
TORSO = 0.3  # share of the torso's range
LOW, HIGH = np.array([-0.48, -0.22, -0.06]), np.array([-0.22, 0.25, 0.20])  # m: where the ball is
BETTER = 3.0  # times
FEW = 5.0  # cm: the centimetre range
PUBLISHED = "in the centimetre range"
UNCALIBRATED, CALIBRATED = "uncalibrated stereo", "calibrated stereo"
LEARNED = (*REGRESSIONS, CORRECTED)

Groups = Mapping[str, Sequence[Mapping[str, Any]]]


def conditions(arguments: argparse.Namespace) -> list[Condition]:
    """Return the only condition of the sweep: the Katana as teacher."""
    poses, looks, postures = QUICK if arguments.quick else (POSES, LOOKS, POSTURES)
    return [Condition("katana", {"teacher": "katana", "poses": poses, "looks": looks, "postures": postures})]


@cache
def rig() -> Rig:
    """Return iCub and Katana as one robot, with the cameras of the iCub."""
    return Rig(two_robots(), cameras_of(two_robots()), CameraSettings().lens)


def trial(settings: dict[str, Any], seed: int) -> dict[str, Any]:
    """Let the Katana teach one iCub where the ball is, and measure stereo and all localisers on poses of the Katana that were held out.

    A localiser is a method that computes the position of the ball from both pictures and the encoders.  Main keys: "errors, NAME",
    distances (N,) m of the computed from the true positions, for stereo and each localiser; "curves", dict from a localiser to its median
    errors [m], one for each number of lessons (labelled samples) in "counts"; "held_out", number of lessons for the test; "reported",
    median error [m] of the positions that the Katana reports; "robot_seconds", robot time of the teaching [s].  `settings`: "poses", number
    of postures of the Katana; "looks", number of looks of the iCub at each; "postures", number of postures of the hand for the calibration
    of stereo.  `seed`: of everything random.
    """
    lessons, time = taught(settings["poses"], settings["looks"], seed)
    learned, held_out = split_by_pose(lessons.poses, HELD_OUT, seed)
    test = lessons[held_out]
    errors = {
        UNCALIBRATED: _off(stereo_places(rig(), np.zeros(len(rig().names)), test.inputs), test),
        CALIBRATED: _off(stereo_places(rig(), _calibrated(settings["postures"], seed), test.inputs), test),
    }
    counts = [*(count for count in COUNTS if count < len(learned)), len(learned)]
    curves = {name: [_learned(name, lessons[learned[:count]], test, seed) for count in counts] for name in LEARNED}
    return {
        **{_errors(name): off for name, off in errors.items()},
        **{_errors(name): curve[-1] for name, curve in curves.items()},
        "curves": {name: [float(np.median(one)) for one in curve] for name, curve in curves.items()},
        "counts": counts,
        "held_out": len(held_out),
        "poses": len(np.unique(lessons.poses)),
        "looks": settings["poses"] * settings["looks"],
        "reported": float(np.median(np.linalg.norm(lessons.reported - lessons.true, axis=1))),
        "robot_seconds": time,
    }


def taught(poses: int, looks: int, seed: int) -> tuple[Lessons, float]:
    """Let the Katana teach an iCub.

    `poses`: number of postures of the Katana.  `looks`: number of looks of the iCub at each.  `seed`: of everything random, also of the
    errors of the iCub's cameras and encoders.

    Returns the lessons (pixels, encoders and reported positions), and the robot time [s] that they took.
    """
    chosen, world = CameraSettings(samples=2), load_world("table")
    world.set_role("ball", "ghost")  # it is drawn where the Katana holds it
    model = Model(rig().robot, world)
    errors = camera_errors(chosen, rig().robot, list(rig().cameras), seed)
    watcher = Watcher(rig(), model, chosen, errors, seed, has_clutter=False)
    rest = watching()
    postures = teacher_postures(rig(), model, BALL, rest, (LOW, HIGH), poses, seed)
    watcher.move(rest, ICUB, 0.0)
    lessons = watch_teacher(watcher, BALL, KATANA, postures, looks, TORSO, seed)
    return Lessons.of(rig().robot, lessons), watcher.plant.time


def _calibrated(postures: int, seed: int) -> Array:
    """Return the calibration parameters (P,) of cameras and head encoders that one iCub finds with pictures of its own hand.

    `postures`: number of postures of the hand.  `seed`: of the true errors of this iCub's cameras and encoders, and of the noise.
    """
    chosen, icub = CameraSettings(samples=2), load_robot("icub")
    own = Rig(icub, cameras_of(icub), chosen.lens, Tag("left_palm"))
    model, errors = Model(icub, load_world("table")), camera_errors(chosen, icub, list(own.cameras), seed)
    hand = choose_postures(own, model, chosen, "left_arm", postures, seed)
    return calibrate(own, watch_hand(Watcher(own, model, chosen, errors, seed), hand, "left_arm"), chosen).x


def _learned(name: str, lessons: Lessons, test: Lessons, seed: int) -> Array:
    """Train a localiser, and return the distances (N,) m of its computed ball positions from the true ones in `test`.

    A localiser is a method that computes the position of the ball from both pictures and the encoders; `name` is one of LEARNED.
    `lessons`: the labelled samples for the training.  `test`: N other samples.  `seed`: of the localiser's random numbers.
    """
    one = localiser(name, rig(), seed)
    one.fit(lessons.inputs, lessons.reported)
    return _off(one.predict(test.inputs), test)


def _off(places: Array, test: Lessons) -> Array:
    found: Array = np.linalg.norm(places - test.true, axis=1)
    return found


def _errors(name: str) -> str:
    return f"errors, {name}"


def _medians(groups: Groups, name: str) -> list[float]:
    """Return the median error in each run [cm], the distance of located from true positions.

    `name`: name of the localiser.
    """
    return [1e2 * float(np.median(run[_errors(name)])) for run in groups["katana"]]


@claim(
    OUR_AIM,
    "a localiser that corrects the stereo of its kinematic model by what the Katana reports is at least 3 times better on held-out poses "
    "than uncalibrated stereo",
    f"at least {BETTER:g} x",
)
def corrected(groups: Groups) -> Measured:
    return _times_better(groups, CORRECTED)


@claim(
    OUR_AIM,
    "a localiser that learns from pixels and encoders alone (Gaussian process), without a kinematic model, is at least 3 times better on "
    "held-out poses than uncalibrated stereo",
    f"at least {BETTER:g} x",
)
def model_free(groups: Groups) -> Measured:
    return _times_better(groups, "Gaussian process")


def _times_better(groups: Groups, name: str) -> Measured:
    before, after = _medians(groups, UNCALIBRATED), _medians(groups, name)
    text, holds = ratio_within(before, after, 1, least=BETTER)
    return f"{text} x: {estimate(after, 2)} cm, uncalibrated {estimate(before, 1)} cm", holds


@claim(
    "Leitner et al. 2012; thesis 4.1.2",
    "a neural network learns from the other robot to place objects in the centimetre range (here: a median of at most 5 cm), "
    "by pixels and encoders alone",
    PUBLISHED,
    untested="the published poses of head and torso and their number",
)
def network(groups: Groups) -> Measured:
    return _centimetres(groups, "neural network")


@claim(
    "Leitner et al. 2012; thesis 4.1.2",
    "genetic programming learns from the other robot to place objects in the centimetre range (here: a median of at most 5 cm), "
    "by pixels and encoders alone",
    PUBLISHED,
    untested="the published poses of head and torso and their number, and the form of the formulas",
)
def programs(groups: Groups) -> Measured:
    return _centimetres(groups, "genetic programming")


def _centimetres(groups: Groups, name: str) -> Measured:
    off = _medians(groups, name)
    return f"median {estimate(off, 1)} cm", decides(interval(off), most=FEW)


CLAIMS = (corrected, model_free, network, programs)


def findings(found: Cells) -> dict[str, Any]:
    """Return the results of the sweep.

    Keys: "localisers", a dict from a localiser (method that computes the position of the ball from pictures and encoders), or from stereo
    without or with calibration, to the median and 95 % quantile of its errors [cm], as text; "robots", a dict from each finished cell (one
    simulated robot) to the numbers of its lessons, poses and time; "claims", a list with the judged claims, as dicts (`Claim.record`).
    """
    groups = grouped(found, "teacher", ("katana",))
    runs = groups.get("katana", [])
    rows = {
        name: {
            "median cm": estimate(_medians(groups, name), 2),
            "95 % cm": estimate([1e2 * float(np.quantile(run[_errors(name)], 0.95)) for run in runs], 1),
            "better than uncalibrated stereo": estimate(
                [before / after for before, after in zip(_medians(groups, UNCALIBRATED), _medians(groups, name), strict=True)], 1
            ),
        }
        for name in (UNCALIBRATED, CALIBRATED, *LEARNED)
        if runs
    }
    robots = {
        name: {
            "lessons": cell.values["counts"][-1],
            "held out": cell.values["held_out"],
            "poses of the Katana": cell.values["poses"],
            "share of the looks with the ball in both pictures": round(
                (cell.values["counts"][-1] + cell.values["held_out"]) / cell.values["looks"], 2
            ),
            "robot time, minutes": round(cell.values["robot_seconds"] / 60.0),
            "error of the reported places, mm": round(1e3 * cell.values["reported"], 2),
        }
        for name, cell in found.items()
    }
    return {"localisers": rows, "robots": robots, "claims": judged(CLAIMS, groups, bool(groups))}


def plot(found: Cells) -> Any:
    """Return a figure of the errors of stereo and of all localisers, and of their medians over the number of lessons.

    A localiser is a method that computes the position of the ball from both pictures and the encoders.
    """
    groups = grouped(found, "teacher", ("katana",))
    runs = groups["katana"]
    drawing = new_figure(9.5, 4.2)
    left, right = drawing.subplots(1, 2)
    names = (UNCALIBRATED, *LEARNED, CALIBRATED)
    colors = dict(zip(names, ("C7", "C1", "C0", "C2", "C4", "C3", "black"), strict=True))
    shares = np.linspace(0.0, 1.0, 300)
    for name in names:
        together = np.concatenate([run[_errors(name)] for run in runs])
        left.plot(1e2 * np.quantile(together, shares), shares, color=colors[name], linewidth=1.2, label=name)
    finish(left, xlabel="error on held-out poses, cm", ylabel="share of the looks", xscale="log", xlim=(0.05, 50.0))
    shared: Ints = np.array([count for count in COUNTS if all(count in run["counts"] for run in runs)], dtype=np.intp)
    at = [*shared.tolist(), float(np.mean([run["counts"][-1] for run in runs]))]
    for name in LEARNED:
        curves = np.array([[*run["curves"][name][: len(shared)], run["curves"][name][-1]] for run in runs])
        draw_band(right, at, list(1e2 * curves.T), "o-", color=colors[name], markersize=3)
    for name in (UNCALIBRATED, CALIBRATED):
        right.axhline(float(np.mean(_medians(groups, name))), color=colors[name], linestyle="--", linewidth=1.0)
    finish(right, xlabel="lessons", ylabel="median error on held-out poses, cm", xscale="log", yscale="log")
    right.set_xticks(at, [f"{count:.0f}" for count in at], minor=False)
    right.minorticks_off()
    drawing.legend(handles=left.get_lines(), loc="outside lower center", ncols=len(names), fontsize=7)
    return drawing


EXPERIMENT = Experiment(
    claim="a robot whose cameras are not calibrated learns from another robot where things are",
    source=f"thesis 4.1.2; Leitner et al. 2012; {OUR_AIM}",
    method=Sweep(conditions, trial, findings, plot, seeds=5),
    claims=CLAIMS,
)
