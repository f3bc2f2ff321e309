# SPDX-License-Identifier: Apache-2.0
"""Gaze on the offline plant, by its own clock, with the motors' limits, lag, play and noise."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest

from mobee.arrays import Array
from mobee.behaviours.gaze import Gaze, gaze_motors
from mobee.behaviours.tracking import TargetTrack
from mobee.control import Gains
from mobee.errors import InvalidValue
from mobee.model.kinematics import link_transforms
from mobee.model.model import Model
from mobee.robot.cameras import cameras_of
from mobee.robot.load import load_robot
from mobee.robot.motor_units import limit_zones
from mobee.simulation.plant import OfflinePlant

ROBOT = load_robot("icub")
MODEL = Model(ROBOT)
EYES = cameras_of(ROBOT)
HEAD = ROBOT.part("head").slice
FOCAL = 120.0 / np.tan(np.deg2rad(25.0))  # px, of the eyes' pictures of 320 x 240
LATENCY, PERIOD = 0.1, 1.0 / 15.0  # s, of pictures
DT = 0.02

Path = Callable[[float], Array]


def new_gaze() -> Gaze:
    return Gaze(ROBOT, EYES, "head", limit_zones(ROBOT, Gains.default().of_robot("limit_width", ROBOT)).max(axis=1))


@dataclass
class Gazed:
    """Per tick: time since the motion began [s], and the larger distance of the target from a picture's centre [px]."""

    times: Array
    pixels: Array

    def caught(self) -> float:
        """The time from which on the target stays within 20 px."""
        far = np.flatnonzero(self.pixels > 20.0)
        return float(self.times[far[-1] + 1])


def gaze_at(path: Path, seconds: float, before: float = 1.5, torso: Path | None = None) -> Gazed:
    """The target rests until time 0; pictures are late and rare, as those of the simulated cameras."""
    plant, gaze, track = OfflinePlant(MODEL, seed=1, dt=DT), new_gaze(), TargetTrack()
    times, pixels, shown = [], [], -np.inf
    for k in range(round((before + seconds) / DT)):
        t = k * DT - before
        if np.floor((t - LATENCY) / PERIOD) > shown:
            shown = np.floor((t - LATENCY) / PERIOD)
            track.note(shown * PERIOD, path(shown * PERIOD))
        known = track.at(t)
        assert known is not None
        moved = gaze.step(plant.q, plant.controller.velocity, *known, DT)
        plant.controller.follow("head", moved.q, moved.velocity)
        if torso is not None:
            plant.controller.set_attractor("torso", torso(t))
        plant.tick()
        off = gaze.offsets(plant.motors.q, path(t + DT))
        assert (off[:, 2] > 0.0).all()
        times.append(t + DT)
        pixels.append(float((FOCAL * np.hypot(off[:, 0], off[:, 1]) / off[:, 2]).max()))
    return Gazed(np.array(times), np.array(pixels))


@pytest.mark.parametrize(
    ("start", "velocity"),
    [((-0.4, -0.25, 0.1), (0.0, 0.2, 0.0)), ((-0.4, 0.1, 0.4), (0.0, 0.0, -0.2)), ((-0.3, 0.05, 0.15), (-0.2, 0.0, 0.0))],
    ids=["across", "down", "away"],
)
def test_a_ball_at_a_fifth_of_a_metre_per_second_stays_in_both_centres(start: tuple[float, ...], velocity: tuple[float, ...]) -> None:
    seen = gaze_at(lambda t: np.array(start) + np.array(velocity) * max(t, 0.0), 2.0)
    assert seen.pixels[seen.times > 1.0].max() < 10.0  # asked for are 20


@pytest.mark.parametrize("yaw", [40.0, -40.0])
def test_a_jump_of_forty_degrees_is_caught(yaw: float) -> None:
    def path(t: float) -> Array:
        angle = np.deg2rad(yaw) * (t > 0.0)
        return np.array([-0.056, 0.0, 0.347]) + 0.45 * np.array([-np.cos(angle), np.sin(angle), -0.35])

    seen = gaze_at(path, 1.2)
    assert seen.pixels[seen.times > 0.0].max() > 150.0
    assert seen.caught() < 0.7  # after the jump, the latency of the pictures included


def test_eyes_and_neck_compensate_the_motion_of_the_torso() -> None:
    middle, swing = np.array([0.0, 0.0, np.deg2rad(8.0)]), np.deg2rad([20.0, 10.0, 12.0])
    seen = gaze_at(lambda t: np.array([-0.45, 0.05, 0.15]), 3.0, torso=lambda t: middle + swing * np.sin(0.5 * np.pi * t) * (t > 0.0))
    assert seen.pixels[seen.times > 0.0].max() < 3.0


def test_eyes_are_the_motors_that_cannot_touch_anything() -> None:
    eyes, neck = gaze_motors(ROBOT, "head", [camera.link for camera in EYES.values()])
    assert [ROBOT.motors[i] for i in eyes] == ["eyes_tilt", "eyes_version", "eyes_vergence"]
    assert [ROBOT.motors[i] for i in neck] == ["neck_pitch", "neck_roll", "neck_yaw"]
    with pytest.raises(InvalidValue, match="left_arm of 'icub' turns none of the cameras"):
        Gaze(ROBOT, EYES, "left_arm")


def test_goals_stay_within_the_limits_and_their_speeds_within_those_of_the_motors(rng: np.random.Generator) -> None:
    gaze, fastest = new_gaze(), np.array([motor.max_velocity for motor in ROBOT.motor_table[HEAD]])
    low, high = ROBOT.limits[HEAD].T
    for _ in range(60):
        moved = gaze.step(ROBOT.home, np.zeros(41), rng.normal(size=3), rng.normal(size=3), DT)
        assert (np.abs(moved.velocity) <= fastest).all()
        assert (moved.q + gaze.lag * moved.velocity >= low - 1e-9).all() and (moved.q + gaze.lag * moved.velocity <= high + 1e-9).all()


def test_a_target_in_the_middle_of_both_pictures_moves_nothing() -> None:
    gaze, q = new_gaze(), ROBOT.home.copy()
    q[HEAD] = np.deg2rad([-8.8, 0.0, 0.0, -7.5, 0.0, 11.0])
    transforms = link_transforms(ROBOT, q)
    places = [transforms[c.link][:3, :3] @ c.position + transforms[c.link][:3, 3] for c in EYES.values()]
    ahead = [transforms[c.link][:3, :3] @ c.rotation[:, 2] for c in EYES.values()]
    along = np.linalg.lstsq(np.stack([ahead[0], -ahead[1]], axis=1), places[1] - places[0])[0]
    target = places[0] + along[0] * ahead[0]
    assert gaze.error(q, target) < 1e-6
    moved = gaze.step(q, np.zeros(41), target, np.zeros(3), DT)
    assert moved.phase == "pursuit" and np.abs(moved.velocity).max() < 0.05


@pytest.mark.parametrize("name", ["q", "velocity", "target", "target_velocity", "dt"])
def test_an_invalid_step_is_refused_and_changes_nothing(name: str) -> None:
    given = {"q": ROBOT.home, "velocity": 0.0 * ROBOT.home, "target": np.array([-0.4, 0.1, 0.1]), "target_velocity": np.zeros(3), "dt": DT}
    gaze, undisturbed = new_gaze(), new_gaze()
    for one in (gaze, undisturbed):
        one.step(**given)
    for wrong in (np.nan * given[name], 0.0) if name == "dt" else (np.nan * given[name], given[name][:2]):
        with pytest.raises(InvalidValue, match=name):
            gaze.step(**{**given, name: wrong})
    assert np.array_equal(gaze.step(**given).q, undisturbed.step(**given).q)
