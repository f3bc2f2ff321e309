# SPDX-License-Identifier: Apache-2.0
"""Step responses of one motor or of many: settling time, overshoot and remaining error."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from experiments.kit.control.plant_runs import PlantRun, icub, place, random_posture, run_plant
from experiments.kit.control.safety import clause_violations
from mobee import Gains
from mobee.arrays import Array
from mobee.simulation import OfflinePlant

STEP, SHARE = np.deg2rad(20.0), 0.25  # rad, share of the range: a single motor steps by the smaller of the two
BAND = 0.05  # of the step, around the end position: settling
REST = 1.0  # s at the end of a run, in which nothing may move
MIN_STEP = np.deg2rad(5.0)  # rad; smaller steps of a motor among others are not judged
TIME_CONSTANTS = 24.0  # duration of a run, in units of damping / stiffness
MOTORS = {"torso": 3, "left_arm": 7, "right_arm": 7}  # motors of each part that step together
MIDDLE = (0.25, 0.75)  # shares of the range in which the motors of a posture are
MARGIN = np.deg2rad(15.0)  # rad, distance of a posture from every constraint


@dataclass(frozen=True, slots=True)
class StepResponse:
    """Measures of a step response: each number is the largest over all joints whose step is at least MIN_STEP (5 degrees).

    The end position of a joint is its mean position in the last second.  `settling`: time until the joint stays within 5 % of the step
    around its end position, s.  `overshoot`: largest motion beyond the end position, as share of the step.  `error_deg`: distance between
    end position and attractor (the commanded position), degrees.  `rest_deg`: standard deviation in the last second, degrees.
    `is_settled`: whether all joints settled before the last second.
    """

    settling: float  # s
    overshoot: float  # share of the step
    error_deg: float  # between end position and attractor
    rest_deg: float  # standard deviation at rest
    is_settled: bool


def motor_step(motor: int) -> tuple[Array, Array]:
    """Return the postures (n,) rad before and after a step of one motor, all other motors at home.

    The step is around the middle of the motor's range; its size is 20 degrees, or a quarter of the range if that is smaller.  `motor`:
    index in `robot.motors`.
    """
    robot = icub().robot
    low, high = robot.limits[motor]
    size = min(STEP, SHARE * (high - low))
    start, end = robot.home.copy(), robot.home.copy()
    start[motor], end[motor] = (low + high - size) / 2.0, (low + high + size) / 2.0
    return start, end


def postures(count: int, seed: int) -> list[Array]:
    """Draw `count` postures (n,) rad of torso and arms, for a motion from home through all of them in order.

    On the path to each posture there are no contacts, neither of solids nor of fields (larger volumes around the solids).  Every cable
    constraint is at least 15 degrees away.  `seed`: seed of the random postures.
    """
    robot, rng = icub().robot, np.random.default_rng(seed)
    found = [robot.home]
    while len(found) <= count:
        q = random_posture(robot, rng, MOTORS, MIDDLE)
        # Motors arrive at different times, so the path is not the line: the torso first, then the arms, and the reverse.
        shares = np.linspace(0.0, 1.0, 11)[:, None, None]
        torso = np.arange(len(q)) < robot.parts["torso"].slice.stop
        corners = np.stack([np.where(torso, q, found[-1]), np.where(torso, found[-1], q)])
        sides = np.stack([np.stack([found[-1], found[-1], found[-1]]), np.stack([*corners, q]), np.stack([q, q, q])])
        path = np.concatenate([a + shares * (b - a) for a, b in pairwise(sides)]).reshape(-1, len(q))
        if clause_violations(robot, path).max() < -MARGIN and not len(icub().evaluate(path).table):
            found.append(q)
    return found[1:]


def run_step(gains: Gains, period_ms: float, start: Array, end: Array, seed: int) -> PlantRun:
    """Run a plant from rest at `start` (n,) rad with the attractor (the commanded posture) at `end` (n,) rad; returns the recording.

    `period_ms`: control period, ms.  `seed`: seed of the plant's random numbers.
    """
    plant = OfflinePlant(icub(), seed, gains, dt=period_ms / 1e3)
    place(plant, start)
    plant.controller.attractor = end
    return run_plant(plant, TIME_CONSTANTS * gains.damping / gains.stiffness)


def step_response(run: PlantRun, start: Array, end: Array) -> StepResponse:
    """Measure the step response in a recording, over the joints whose step is at least MIN_STEP (5 degrees).

    `start`, `end`: postures before and after the step, (n,) rad.
    """
    moved = np.abs(end - start) >= MIN_STEP
    rest = run.last(REST).q[:, moved]
    final = rest.mean(axis=0)
    beyond = (run.q[:, moved] - final) / (end - start)[moved]
    outside = np.abs(beyond) > BAND
    settling = run.dt * max(int(np.flatnonzero(row)[-1]) + 1 if row.any() else 0 for row in outside.T)
    return StepResponse(
        settling,
        overshoot=float(np.maximum(beyond, 0.0).max()),
        error_deg=float(np.rad2deg(np.abs(end[moved] - final).max())),
        rest_deg=float(np.rad2deg(rest.std(axis=0).max())),
        is_settled=bool(settling <= run.times[-1] - REST),
    )
