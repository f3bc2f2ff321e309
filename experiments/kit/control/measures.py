# SPDX-License-Identifier: Apache-2.0
"""Measures of recorded runs: the safety of their postures, and the step responses of motors.

Safety: violated constraints and limits, depths of contacts, oscillation of a marker.  Step responses of one motor or of many: settling
time, overshoot and remaining error.  The functions share no code with the control law, which they judge.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from itertools import pairwise

import numpy as np

from experiments.kit.control.plant_runs import PlantRun, icub, place, random_posture, run_plant
from mobee import Gains
from mobee.arrays import Array
from mobee.model.model import Model
from mobee.robot.robot import Robot
from mobee.simulation import OfflinePlant
from services.robot_sim.bullet_scene import load_solid_pairs

WINDOW = 1.0  # s of the moving mean; a contact oscillates twice a second or faster
AT_STOP = np.deg2rad(0.01)  # rad; a motor nearer to a limit is at its hard stop
STEP, SHARE = np.deg2rad(20.0), 0.25  # rad, share of the range: a single motor steps by the smaller of the two
BAND = 0.05  # of the step, around the end position: settling
REST = 1.0  # s at the end of a run, in which nothing may move
MIN_STEP = np.deg2rad(5.0)  # rad; smaller steps of a motor among others are not judged
TIME_CONSTANTS = 24.0  # duration of a run, in units of damping / stiffness
MOTORS = {"torso": 3, "left_arm": 7, "right_arm": 7}  # motors of each part that step together
MIDDLE = (0.25, 0.75)  # shares of the range in which the motors of a posture are
MARGIN = np.deg2rad(15.0)  # rad, distance of a posture from every constraint


def clause_violations(robot: Robot, q: Array) -> Array:
    """Return the violation of every clause of the robot in postures q (T, n) rad: (T, clauses) rad, above 0 where a clause is violated.

    A clause is a condition on several motors: at least one of its inequalities a.q + b > 0 (its rows) must hold.  The violation of a row is
    -(a.q + b) / |a|; the violation of a clause is the smallest violation among its rows.
    """
    return np.stack([np.min(-(q @ c.a.T + c.b) / np.linalg.norm(c.a, axis=1), axis=1) for c in robot.clauses], axis=1)


def limit_violations(robot: Robot, q: Array) -> Array:
    """Return how far every motor is beyond its nearer limit in postures q (T, n) rad: (T, n) rad, negative within the limits."""
    return np.maximum(robot.limits[:, 0] - q, q - robot.limits[:, 1])


def speeds_at_stops(robot: Robot, run: PlantRun, start: Array) -> Array:
    """Return the speeds (T, n) rad/s of the motors in the ticks in which they are at a hard stop, and 0 in all other ticks.

    `start`: posture before the first tick, (n,) rad.  A motor is at a stop if it is less than AT_STOP (0.01 degrees) from a limit.
    """
    speeds: Array = np.diff(run.q, axis=0, prepend=start[None]) / run.dt * (limit_violations(robot, run.q) > -AT_STOP)
    return speeds


def clause_label(robot: Robot, number: int) -> str:
    """Return a clause of the robot, a condition on several motor positions, as text: inequalities in degrees.

    `number`: index of the clause in `robot.clauses`.  The prefixes `l_` and `r_` of the motors are left out.
    """
    rows = []
    for a, b in zip(robot.clauses[number].a, robot.clauses[number].b, strict=True):
        terms = [f"{a[i]:+.3g} {robot.motors[i].split('_', 1)[1]}" for i in np.flatnonzero(a)]
        rows.append(f"{' '.join(terms)} > {-np.rad2deg(b):.4g}")
    return " or ".join(rows)


@dataclass(frozen=True, slots=True)
class Depths:
    """The depths of the deepest contacts of a run, in m; 0 where there was no contact.

    `solid`: deepest contact between two solids that counts as a collision by `is_listed`.  `field`: deepest contact of fields, which are
    larger volumes that cause repulsive forces.  `pair`: names of the two solids of the contact `solid`, "" if there was no such contact.
    `beside`: deepest contact between two solids that does not count as a collision, such as an upper arm beside the pelvis.
    """

    solid: float
    field: float
    pair: str
    beside: float


def deepest(model: Model, q: Array) -> Depths:
    """Return the largest contact depths, in m, of the model over all the postures q (T, n) rad together, as one `Depths`."""
    table = model.evaluate(q).table
    depth = {True: 0.0, False: 0.0}
    pair = ""
    for row in np.flatnonzero(table.kind == 0):
        first, second = table.name(table.first[row]), table.name(table.second[row])
        counts, deep = is_listed(first, second), float(table.depth[row])
        if deep > depth[counts]:
            depth[counts] = deep
            pair = f"{first} in {second}" if counts else pair
    fields = table.depth[table.kind == 1]
    return Depths(depth[True], float(fields.max(initial=0.0)), pair, depth[False])


def oscillation(model: Model, run: PlantRun, marker: str) -> float:
    """Return the largest distance [m] of a marker from its moving mean over WINDOW (1 s) in a run.

    Slow motion does not count as oscillation.
    """
    path = model.evaluate(run.q).position(marker)
    window = min(len(path), round(WINDOW / run.dt))
    total = np.concatenate([np.zeros((1, 3)), np.cumsum(path, axis=0)])
    mean = (total[window:] - total[:-window]) / window
    middle = path[window // 2 : window // 2 + len(mean)]
    return float(np.linalg.norm(middle - mean, axis=1).max())


@cache
def is_listed(first: str, second: str) -> bool:
    """Return whether a contact of two solids counts as a collision; `first`, `second`: names of their shapes.

    It counts if an object of the world takes part, or if the pair of links is in the simulator's list of pairs (solid_pairs.json). Pairs
    that overlap in some legal poses, such as upper arm and pelvis, are not in the list; their fields exert no force either.
    """
    one, other = _link(first), _link(second)
    return one is None or other is None or frozenset((one, other)) in _pairs()


@cache
def _pairs() -> set[frozenset[str]]:
    return load_solid_pairs().links()


@cache
def _links() -> tuple[str, ...]:
    """Return the names of all links in the simulator's list of pairs (solid_pairs.json), the longest first."""
    names = {name for pair in _pairs() for name in pair}
    return tuple(sorted(names, key=len, reverse=True))


def _link(shape: str) -> str | None:
    """Return the link with which the name of a shape begins, None for an object of the world."""
    return next((link for link in _links() if shape == link or shape.startswith(f"{link}_")), None)


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
