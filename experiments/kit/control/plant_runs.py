# SPDX-License-Identifier: Apache-2.0
"""Recorded runs of the offline plant under the control law, and forces (PUSHES) that a client program can exert during a run."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np

from mobee import Controller, Model, load_robot, load_world
from mobee.arrays import Array
from mobee.robot.robot import Robot
from mobee.simulation import OfflinePlant

GAINS = ("default", "published_2014")
PERIOD = {"default": 0.01, "published_2014": 0.02}  # s, control period of each gain set
COLORS = {"default": "tab:blue", "published_2014": "tab:orange"}  # of the gain sets in figures
REST_TIME = 0.4  # s until motors with a lag of 50 ms are at rest


@lru_cache(maxsize=1)
def icub() -> Model:
    """Return the model of the iCub in an empty world; every call returns the same object."""
    return Model(load_robot("icub"))


@lru_cache(maxsize=1)
def icub_at_table() -> Model:
    """Return the model of the iCub at its table; every call returns the same object."""
    return Model(load_robot("icub"), load_world("table"))


@dataclass(frozen=True, slots=True, eq=False)
class PlantRun:
    """A recording of T ticks of a plant; row t is the end of tick t, counted from 0.

    `q`: (T, n) rad, true joint positions, not encoder readings.  `velocity`: (T, n) rad/s, commanded.  `dt`: s, duration of a tick.
    """

    q: Array  # (T, n) rad, true joint positions, not encoder readings
    velocity: Array  # (T, n) rad/s, commanded
    dt: float  # s

    @property
    def times(self) -> Array:
        """The time of the end of each tick, (T,) s, from the beginning of the run."""
        times: Array = self.dt * np.arange(1.0, len(self.q) + 1.0)
        return times

    def last(self, seconds: float) -> PlantRun:
        """Return the recording of the last `seconds` of the run."""
        count = round(seconds / self.dt)
        return PlantRun(self.q[-count:], self.velocity[-count:], self.dt)


def run_plant(
    plant: OfflinePlant, seconds: float, before: Callable[[int], None] | None = None, at: Collection[int] | None = None
) -> PlantRun:
    """Run the plant for `seconds`, at least one tick, and return the recording.

    `before`: function that is called before a tick, with the index of the tick, counted from 0.  `at`: indices of the ticks before which
    it is called; None: all ticks.
    """
    ticks = max(1, round(seconds / plant.dt))
    calls = () if before is None else range(ticks) if at is None else at
    traces = []
    for first, end in pairwise(sorted({0, ticks, *(tick for tick in calls if tick < ticks)})):
        if before is not None and first in calls:
            before(first)
        traces.append(plant.run(end - first))
    return PlantRun(np.concatenate([t.q for t in traces]), np.concatenate([t.velocity for t in traces]), plant.dt)


def place(plant: OfflinePlant, q: Array) -> None:
    """Put a plant at rest in the posture q (n,) rad, with its attractor there.

    The plant runs for REST_TIME (0.4 s); after this time the motors are at rest.  The joints are put back to q before every tick.
    """
    plant.controller.reset(q)
    for _ in range(round(REST_TIME / plant.dt)):
        plant.motors.adopt(q)
        plant.tick()
    plant.motors.adopt(q)
    plant.controller.reset(q)


def random_posture(robot: Robot, rng: np.random.Generator, motors: Mapping[str, int], within: tuple[float, float]) -> Array:
    """Draw a random posture (n,) rad of a robot.

    `motors`: dict from the name of a part to a number k: the positions of its first k motors are drawn; all other motors are at home.
    `within`: lowest and highest share of a motor's range; the position is drawn uniformly between them.
    """
    q = robot.home.copy()
    for part, count in motors.items():
        where = slice(robot.parts[part].start, robot.parts[part].start + count)
        low, high = robot.limits[where].T
        q[where] = low + rng.uniform(*within, count) * (high - low)
    return q


Push = Callable[[Controller, float], None]  # N/kg at a marker, rad/s^2 at a motor; before the squash


def _marker(marker: str, direction: tuple[float, float, float]) -> Push:
    return lambda controller, force: controller.push(marker, force * np.array(direction))


def _both(x: float, y: float, z: float) -> Push:
    """Return a push of both palms: along (x, y, z) in the root frame at the left palm, along (x, -y, z) at the right palm."""

    def push(controller: Controller, force: float) -> None:
        controller.push("left_palm", force * np.array([x, y, z]))
        controller.push("right_palm", force * np.array([x, -y, z]))

    return push


def _motors(part: str, sign: float) -> Push:
    def push(controller: Controller, force: float) -> None:
        f = np.zeros(len(controller.robot.motors))
        f[controller.robot.parts[part].slice] = sign * force
        controller.force(f)

    return push


def _together(*pushes: Push) -> Push:
    """Return a push that applies all the given pushes at the same time."""

    def push(controller: Controller, force: float) -> None:
        for each in pushes:
            each(controller, force)

    return push


# Root frame: x backwards, y right, z up.
PUSHES: dict[str, Push] = {
    "table-left-hand": _marker("left_palm", (0.0, 0.0, -1.0)),
    "table-right-hand": _marker("right_palm", (0.0, 0.0, -1.0)),
    "table-both-hands": _both(0.0, 0.0, -1.0),
    "table-edge": _marker("left_palm", (0.7, 0.0, -0.7)),
    "chest": _marker("left_palm", (1.0, 0.2, 0.0)),
    "other-hand": _both(0.0, 1.0, 0.0),
    "face": _marker("right_palm", (0.7, -0.5, 0.5)),
    "limits-arm+": _motors("left_arm", 1.0),
    "limits-arm-": _motors("left_arm", -1.0),
    "limits-torso+": _motors("torso", 1.0),
    "limits-torso-": _motors("torso", -1.0),
    "table-hand-and-torso": _together(_marker("left_palm", (0.0, 0.0, -1.0)), _motors("torso", 1.0)),
    "limits-hand-and-arm": _together(_marker("left_palm", (0.0, 0.0, 1.0)), _motors("left_arm", 1.0)),
}
