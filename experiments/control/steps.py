"""Steps of one motor or of many, and what is measured of the response."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from experiments.control.margins import clause_violations
from experiments.control.models import icub
from experiments.control.postures import random_posture
from experiments.control.ride import Ride, place, ride
from mobee import Gains
from mobee.robot.robot import Array
from mobee.simulation import OfflinePlant

STEP, SHARE = np.deg2rad(20.0), 0.25  # rad, of the range: the smaller is the step of a motor alone
BAND = 0.05  # of the step
REST = 1.0  # s, the end of a ride, in which nothing may move
WORTH = np.deg2rad(5.0)  # a smaller step of a motor among others is not judged
TIME_CONSTANTS = 24.0  # a ride lasts so many of damping / stiffness
LATTICE = {"torso": 3, "left_arm": 7, "right_arm": 7}
MIDDLE = (0.25, 0.75)  # of the range of a motor in a posture
MARGIN = np.deg2rad(15.0)  # from every constraint, of a posture


@dataclass(frozen=True, slots=True)
class Measured:
    """What came of a step."""

    settling: float  # s
    overshoot: float  # of the step
    error_deg: float  # between rest and attractor
    rest_deg: float  # standard deviation at rest
    is_settled: bool


def motor_step(motor: int) -> tuple[Array, Array]:
    """From below the middle of a motor's range to above it, the others at home."""
    robot = icub().robot
    low, high = robot.limits[motor]
    size = min(STEP, SHARE * (high - low))
    start, end = robot.home.copy(), robot.home.copy()
    start[motor], end[motor] = (low + high - size) / 2.0, (low + high + size) / 2.0
    return start, end


def postures(count: int, seed: int) -> list[Array]:
    """Random postures of torso and arms, one after the other from home, with nothing in the way that any field would feel."""
    robot, rng = icub().robot, np.random.default_rng(seed)
    found = [robot.home]
    while len(found) <= count:
        q = random_posture(robot, rng, LATTICE, MIDDLE)
        # Motors get there at different times, so the way is not the line: the torso first, then the arms, and the other way round.
        ways = np.linspace(0.0, 1.0, 11)[:, None, None]
        torso = np.arange(len(q)) < robot.parts["torso"].slice.stop
        corners = np.stack([np.where(torso, q, found[-1]), np.where(torso, found[-1], q)])
        sides = np.stack([np.stack([found[-1], found[-1], found[-1]]), np.stack([*corners, q]), np.stack([q, q, q])])
        path = np.concatenate([a + ways * (b - a) for a, b in pairwise(sides)]).reshape(-1, len(q))
        if clause_violations(robot, path).max() < -MARGIN and not len(icub().evaluate(path).table):
            found.append(q)
    return found[1:]


def step_ride(gains: Gains, period_ms: float, start: Array, end: Array, seed: int) -> Ride:
    """At rest at `start` (n,) rad, then the attractor is `end`."""
    plant = OfflinePlant(icub(), seed, gains, dt=period_ms / 1e3)
    place(plant, start)
    plant.controller.attractor = end
    return ride(plant, TIME_CONSTANTS * gains.damping / gains.stiffness)


def judge(done: Ride, start: Array, end: Array) -> Measured:
    """Measure the joints that had to go WORTH or farther."""
    moved = np.abs(end - start) >= WORTH
    rest = done.last(REST).q[:, moved]
    final = rest.mean(axis=0)
    beyond = (done.q[:, moved] - final) / (end - start)[moved]
    outside = np.abs(beyond) > BAND
    settling = done.dt * max(int(np.flatnonzero(row)[-1]) + 1 if row.any() else 0 for row in outside.T)
    return Measured(
        settling,
        overshoot=float(np.maximum(beyond, 0.0).max()),
        error_deg=float(np.rad2deg(np.abs(end[moved] - final).max())),
        rest_deg=float(np.rad2deg(rest.std(axis=0).max())),
        is_settled=bool(settling <= done.times[-1] - REST),
    )
