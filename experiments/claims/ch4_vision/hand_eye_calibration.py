# SPDX-License-Identifier: Apache-2.0
"""Calibration of imperfect cameras by looking at the robot's own hand (thesis 4.1.2): errors of a ball's position before and after.

Claim: a robot calibrates its cameras with pictures of its own hand, and correctly computes the covariance of the remaining error.
Source: in thesis 4.1.2 one robot learns from another one where things are, without numbers for calibrated stereo.  Aims of this
reproduction: after `mobee calibrate` the position of a ball is wrong by at most 5 mm (median) and 15 mm (95 %), over 500 random gazes and
places (100 for each of 5 robots), with cameras displaced by up to 2 cm and 2 deg and head encoders that are wrong by up to 1 deg; and the
reported covariance is correct: the squared error, normalised by this covariance, is below the 95 % quantile of its distribution for 90 to
98 % of the places.

A trial draws the errors of one robot and calibrates it by 40 postures of its hand.  Then a ball is put at random places in view of both
cameras.  All pictures are rendered with distortion, noise and motion blur, in a cluttered room.  "Before" the calibration, a position is
the point nearest to the two rays of the ball, by the cameras of the model; "after" it, the position is computed from the outlines in the
same pictures (`mobee.vision.objects`).  Only pictures from which both positions can be computed count.  Run time: one minute a robot on one
core.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any

import numpy as np

from experiments.kit.command_line import positive_whole
from experiments.kit.experiment import OUR_AIM, Experiment, Measured, claim, judged
from experiments.kit.plots import finish, finish_normalised, new_figure
from experiments.kit.rules import all_hold, decides
from experiments.kit.statistics import chi_squared, estimate, interval
from experiments.kit.sweep import Cells, Condition, Sweep, grouped
from mobee.arrays import Array
from mobee.model.kinematics import link_transforms
from mobee.model.model import Model
from mobee.model.world_file import load_world
from mobee.rendering.scene import Scene, clutter, room
from mobee.robot.cameras import cameras_of
from mobee.robot.load import load_robot
from mobee.vision.ball import Sighting, find_balls
from mobee.vision.calibration.calibration import Calibration
from mobee.vision.calibration.observing import Watcher, choose_postures, watch_hand
from mobee.vision.calibration.solve import calibrate
from mobee.vision.encoders import Moment
from mobee.vision.imperfections import CameraErrors, Cameras, CameraSettings, camera_errors
from mobee.vision.lens import camera_frames, into
from mobee.vision.objects.detectors import detector_of
from mobee.vision.objects.placing import eyes_at, locate_all
from mobee.vision.objects.thing import things_in
from mobee.vision.rig import Rig, see_points
from mobee.vision.stereo import Sighted, rays_meet
from mobee.vision.tag import Tag

POSTURES, PLACES = 40, 100  # of the hand; of the ball, for each of 5 robots
QUICK_POSTURES, QUICK_PLACES = 12, 10
MEDIAN, MOST = 5.0, 15.0  # mm
HONEST = (0.90, 0.98)  # share of places within the 95 % band
LOW, HIGH = np.array([-0.50, -0.25, -0.07]), np.array([-0.22, 0.25, 0.20])  # m: where balls are
DISTANCES = (0.22, 0.60)  # m from a camera
SAME = 5.0  # px between a round red thing and the expected place of the ball
BORDER = 40.0  # px of the pictures in which the model's cameras do not have the ball
READINGS, ENCODER = 7, float(np.deg2rad(0.1 * np.sqrt(2.0)))  # of each encoder around a stamp; rad, deviation of one

Groups = Mapping[str, Sequence[Mapping[str, Any]]]


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the option --places, the number of places of the ball, to the parser."""
    parser.add_argument("--places", type=positive_whole, default=PLACES, metavar="N", help="places of the ball (default: %(default)s)")


def conditions(arguments: argparse.Namespace) -> list[Condition]:
    """Return the only condition of the sweep: calibration by the hand."""
    numbers = (QUICK_POSTURES, QUICK_PLACES) if arguments.quick else (POSTURES, arguments.places)
    return [Condition("hand", {"calibration": "hand", "postures": numbers[0], "places": numbers[1]})]


@cache
def rig() -> Rig:
    """Return the iCub with its cameras and a tag (a printed marker) on its left palm."""
    robot = load_robot("icub")
    return Rig(robot, cameras_of(robot), CameraSettings().lens, Tag("left_palm"))


def trial(settings: dict[str, Any], seed: int) -> dict[str, Any]:
    """Draw the camera errors of one robot, calibrate its cameras with a tag on its own palm, and measure a ball's position at N places.

    Main keys: "before" and "after", errors of the ball's position without and with the calibration (N,) m; "normalised", squared errors
    after calibration, normalised by the covariance that the robot computes (N,); "hand_before" and "hand_after", median errors of the hand
    [m]; "normalised_parameters", squared error of the calibrated parameters, normalised by their covariance.  `settings`: "postures",
    number of postures of the hand for the calibration; "places", number of places of the ball.  `seed`: of everything random.
    """
    chosen, model = CameraSettings(samples=2), Model(rig().robot, load_world("table"))
    errors = camera_errors(chosen, rig().robot, list(rig().cameras), seed)
    postures = choose_postures(rig(), model, chosen, "left_arm", settings["postures"], seed)
    found = calibrate(rig(), watch_hand(Watcher(rig(), model, chosen, errors, seed), postures, "left_arm"), chosen)
    off = found.x - rig().parameters(errors)
    shown = _shown_balls(found, chosen, errors, model, settings["places"], seed)
    return {
        "normalised_parameters": float(off @ np.linalg.solve(found.covariance, off)),
        "hand_before": found.uncalibrated.metres_median,
        "hand_after": found.calibrated.metres_median,
        "moments": found.pictures,
        **shown,
    }


def _shown_balls(
    found: Calibration, settings: CameraSettings, errors: CameraErrors, model: Model, places: int, seed: int
) -> dict[str, Any]:
    """Show a ball at random places until its position was computed `places` times, at most 3 `places` times.

    Keys: "before", "after" and "normalised", as in `trial`; "pixel_error", rms error of the ball's middle in the pictures [px]; "shown",
    number of shown balls; "sighted", number of those that were found in the pictures of both cameras.
    """
    robot, rng = rig().robot, np.random.default_rng([seed, 0x62616C6C])
    scene = Scene(robot, load_world("table"), rig().cameras, around=[*room(seed), *clutter(model.world.objects.values(), seed)])
    cameras = Cameras(scene, settings, errors, seed)
    solids, things = [item for item in model.world.objects.values() if item.role == "obstacle"], things_in(model.world)
    detect = detector_of("color", things)
    rows: list[tuple[float, float, float]] = []
    pixels: list[Array] = []
    shown = sighted = 0
    while len(rows) < places and shown < 3 * places:
        q, ball = random_gaze(rng)
        scene.place("ball", ball, np.array([1.0, 0.0, 0.0, 0.0]))
        shown += 1
        pictures = {name: cameras.expose(name, [q] * settings.samples) for name in rig().cameras}
        balls = {name: find_balls(picture, rig().lens.matrix, rig().lens.distortion) for name, picture in pictures.items()}
        if not all(balls.values()):
            continue
        sighted += 1
        noise = ENCODER / np.sqrt(READINGS)
        moment = Moment(q + noise * rng.standard_normal(len(q)), np.zeros(len(q)), np.full(len(q), noise**2))
        eyes = eyes_at(rig(), found.x, moment, found.covariance, settings.jitter)
        seen = locate_all(things, {name: detect(picture) for name, picture in pictures.items()}, eyes, solids)
        if not seen:
            continue
        place = seen[0]
        middles = {name: _middle(name, some, found, moment, place.position) for name, some in balls.items()}
        first = {name: Sighted(middle, 1.0) for name, middle in middles.items() if middle is not None}
        if len(first) < len(middles):
            continue
        before = rays_meet(rig(), np.zeros(len(found.x)), moment, first)
        if before is None:
            continue
        error = place.position - ball
        normalised = float(error @ np.linalg.solve(place.covariance, error))
        rows.append((float(np.linalg.norm(before - ball)), float(np.linalg.norm(error)), normalised))
        true = rig().parameters(errors)
        pixels += [
            one.pixel - see_points(rig(), name, true, q[None], 0.0 * q[None], ball[None, None]).pixels[0, 0] for name, one in first.items()
        ]
    befores, afters, all_normalised = np.array(rows).T
    return {
        "before": befores,
        "after": afters,
        "normalised": all_normalised,
        "pixel_error": float(np.sqrt((np.array(pixels) ** 2).mean())),
        "shown": shown,
        "sighted": sighted,
    }


def _middle(name: str, balls: Sequence[Sighting], found: Calibration, moment: Moment, place: Array) -> Array | None:
    """Return the middle (2,) px of the round red thing in a picture that is at a place (3,) m, root frame.

    `name`: name of the camera.  `balls`: the round red things that were found in its picture.  `found` and `moment`: calibration and
    encoder values, from which the pixel of the place is computed.  Returns None if no thing is within 5 px of this pixel.
    """
    expected = see_points(rig(), name, found.x, moment.q[None], moment.dq[None], place[None, None]).pixels[0, 0]
    middle = min((rig().lens.project(one.direction) for one in balls), key=lambda pixel: float(np.linalg.norm(pixel - expected)))
    return middle if np.linalg.norm(middle - expected) < SAME else None


def random_gaze(rng: np.random.Generator) -> tuple[Array, Array]:
    """Draw a random posture of the head and a position of the ball that both cameras would see.

    Returns the posture (n,) rad and the position (3,) m, root frame.  The cameras are those of the model, without errors.
    """
    robot = rig().robot
    low, high = robot.limits[list(rig().head)].T
    while True:
        ball = rng.uniform(LOW, HIGH)
        q = np.repeat(robot.home[None], 400, axis=0)
        q[:, list(rig().head)] = rng.uniform(low, high, (400, len(low)))
        transforms, fits = link_transforms(robot, q), np.ones(400, bool)
        for camera in rig().cameras.values():
            local = into(*camera_frames(camera, transforms, np.zeros(6)), np.broadcast_to(ball, (400, 3)))
            seen, distance = rig().lens.project(local), np.linalg.norm(local, axis=1)
            inside = ((seen > BORDER) & (seen < np.array([320.0, 240.0]) - BORDER)).all(axis=1)
            fits &= inside & (distance > DISTANCES[0]) & (distance < DISTANCES[1]) & ((local[:, :2] ** 2).sum(axis=1) < local[:, 2] ** 2)
        if fits.any():
            return q[int(rng.choice(np.flatnonzero(fits)))], ball


def _millimetres(groups: Groups, field: str, share: float) -> list[float]:
    """Return for each robot a quantile of its errors of the ball's position, mm.

    `field`: "before" or "after" the calibration.  `share`: which quantile, 0 to 1.
    """
    return [1e3 * float(np.quantile(run[field], share)) for run in groups["hand"]]


@claim(
    OUR_AIM,
    "after the calibration a ball is placed within 5 mm (median) and 15 mm (95 %) over 500 random gazes and places",
    f"{MEDIAN:g} and {MOST:g} mm",
)
def accuracy(groups: Groups) -> Measured:
    after = {share: _millimetres(groups, "after", share) for share in (0.5, 0.95)}
    before = {share: _millimetres(groups, "before", share) for share in (0.5, 0.95)}
    text = (
        f"median {estimate(after[0.5], 1)} mm, 95 % {estimate(after[0.95], 1)} mm; "
        f"before {estimate(before[0.5], 0)} and {estimate(before[0.95], 0)} mm"
    )
    return text, all_hold([decides(interval(after[0.5]), most=MEDIAN), decides(interval(after[0.95]), most=MOST)])


@claim(
    OUR_AIM,
    "the reported covariance of a ball's position is honest: the normalised error is within its 95 % band for 90 to 98 % of the places",
    "90 to 98 %",
)
def honest(groups: Groups) -> Measured:
    band = chi_squared(0.95, 3)
    shares = [float(np.mean(np.asarray(run["normalised"]) <= band)) for run in groups["hand"]]
    return f"share {estimate(shares, 3)}", decides(interval(shares), *HONEST)


CLAIMS = (accuracy, honest)


def findings(found: Cells) -> dict[str, Any]:
    """Return the results of the sweep.

    Keys: "runs", a dict from each finished cell (one simulated robot) to its numbers, such as "before, median mm" and "after, median mm",
    the errors of the ball's position before and after the calibration; "claims", a list with the judged claims, as dicts (`Claim.record`).
    """
    groups = grouped(found, "calibration", ("hand",))
    band = chi_squared(0.95, 3)
    rows = {
        name: {
            "places": len(cell.values["after"]),
            "found in both pictures": round(cell.values["sighted"] / cell.values["shown"], 3),
            "before, median mm": round(1e3 * float(np.median(cell.values["before"])), 1),
            "before, 95 % mm": round(1e3 * float(np.quantile(cell.values["before"], 0.95)), 1),
            "after, median mm": round(1e3 * float(np.median(cell.values["after"])), 2),
            "after, 95 % mm": round(1e3 * float(np.quantile(cell.values["after"], 0.95)), 2),
            "within the 95 % band": round(float(np.mean(np.asarray(cell.values["normalised"]) <= band)), 3),
            "normalised error of the parameters": round(cell.values["normalised_parameters"], 1),
            "ball's pixel error, rms": round(cell.values["pixel_error"], 3),
        }
        for name, cell in found.items()
    }
    return {"runs": rows, "claims": judged(CLAIMS, groups, bool(groups))}


def plot(found: Cells) -> Any:
    """Return a figure of the distributions of the position error before and after calibration, and of the normalised error.

    The normalised error is the squared position error, normalised by the covariance that the robot computes.  It is drawn beside the
    distribution that it has if the covariance is correct, chi-squared with 3 degrees of freedom.
    """
    runs = grouped(found, "calibration", ("hand",))["hand"]
    drawing = new_figure(9.0, 3.6)
    left, right = drawing.subplots(1, 2)
    shares = np.linspace(0.0, 1.0, 400)
    for field, color in (("before", "C7"), ("after", "C0")):
        for number, run in enumerate(runs):
            errors = np.quantile(run[field], shares)
            left.plot(1e3 * errors, shares, color=color, linewidth=1.0, label=f"{field} (a line for each robot)" if number == 0 else None)
    for value, level in ((MEDIAN, 0.5), (MOST, 0.95)):
        left.plot([value], [level], "x", color="C3", label="aim" if level == 0.5 else None)
    finish(left, xlabel="error of the ball's position, mm", ylabel="share of the places", xscale="log", xlim=(0.3, 1000.0))
    left.legend(fontsize=7, loc="lower right")
    for number, run in enumerate(runs):
        right.plot(np.quantile(run["normalised"], shares), shares, color="C0", linewidth=1.0, label="measured" if number == 0 else None)
    finish_normalised(right)
    return drawing


EXPERIMENT = Experiment(
    claim="a robot that looks at its own hand calibrates its cameras: a ball is placed within millimetres, and the covariance is honest",
    source=f"{OUR_AIM}; thesis 4.1.2",
    method=Sweep(conditions, trial, findings, plot, seeds=5, add_options=add_options),
    claims=CLAIMS,
)
