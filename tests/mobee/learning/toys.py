# SPDX-License-Identifier: Apache-2.0
"""A robot of motors only, and plants that answer at once: what learning needs of the world, without a world."""

from __future__ import annotations

import heapq

import numpy as np

from mobee.arrays import Array
from mobee.errors import ActionInterrupted
from mobee.learning.lattice import Lattice
from mobee.plant import Outcome
from mobee.robot.robot import Motor, Part, Robot

# iCub simulator, degrees
TORSO = {"torso_yaw": (-50, 50), "torso_roll": (-30, 30), "torso_pitch": (-10, 70)}
ARM = {"shoulder_pitch": (-95, 10), "shoulder_roll": (0, 160.8), "shoulder_yaw": (-37, 80), "elbow": (15.5, 106), "wrist_prosup": (-90, 90)}
SHOULDER_ELBOW = ("shoulder_pitch", "shoulder_roll", "shoulder_yaw", "elbow")


def toy_robot() -> Robot:
    motors: list[Motor] = []
    parts = {}
    table = {"torso": TORSO, "left_arm": {f"l_{k}": v for k, v in ARM.items()}, "right_arm": {f"r_{k}": v for k, v in ARM.items()}}
    for part, limits in table.items():
        parts[part] = Part(part, tuple(limits), len(motors))
        motors += [Motor(name, part, np.deg2rad(low_high), 0.0, ()) for name, low_high in limits.items()]
    none = np.empty((0, 2), dtype=np.intp)
    return Robot("toy", ("base",), (), tuple(motors), parts, {}, (), (), none, none)


def arm(levels=(0.25, 0.5, 0.75), neighbours=16, tie_seed=0, side="l") -> Lattice:
    return Lattice(toy_robot(), [f"{side}_{name}" for name in SHOULDER_ELBOW], levels, neighbours, tie_seed)


def torso() -> Lattice:
    return Lattice(toy_robot(), list(TORSO), neighbours=8)


class InstantPlant:
    """Ends every action at its target, at once."""

    def __init__(self, robot: Robot, start: dict[str, Array] | None = None) -> None:
        self.robot = robot
        self.q = {name: robot.limits[part.slice].mean(axis=1) for name, part in robot.parts.items()} | (start or {})

    def measure(self, part: str) -> Array:
        return self.q[part].copy()

    def act(self, part: str, target: Array) -> Outcome:
        self.q[part] = target.copy()
        return Outcome(target.copy(), settled=True, duration=1.0)


class FickleDice(InstantPlant):
    """Leaves one action in four where it was; the draws follow from the seed and the number of actions."""

    def __init__(self, robot: Robot, seed: int, actions: int = 0, start: dict[str, Array] | None = None) -> None:
        super().__init__(robot, start)
        self.seed, self.actions = seed, actions

    def act(self, part: str, target: Array) -> Outcome:
        self.actions += 1
        stays = np.random.default_rng([self.seed, self.actions]).random() < 0.25
        return super().act(part, self.q[part] if stays else target)


class Interrupting(InstantPlant):
    """Interrupts the actions of the given numbers, leaving the part half way."""

    def __init__(self, robot: Robot, interrupted: set[int]) -> None:
        super().__init__(robot)
        self.interrupted, self.actions = interrupted, 0

    def act(self, part: str, target: Array) -> Outcome:
        self.actions += 1
        if self.actions in self.interrupted:
            self.q[part] = self.robot.limits[self.robot.part(part).slice, 0].copy()
            raise ActionInterrupted("held")
        return super().act(part, target)


class ToyConcurrent(InstantPlant):
    """Parts move at once, each action taking its part's own time; a second action of a busy part is an error."""

    def __init__(self, robot: Robot, durations: dict[str, float]) -> None:
        super().__init__(robot)
        self.durations, self.time = durations, 0.0
        self.log: list[tuple[float, str]] = []
        self._queue: list[tuple[float, str]] = []
        self._targets: dict[str, Array] = {}

    def begin(self, part: str, target: Array) -> None:
        assert part not in self._targets
        self._targets[part] = target
        heapq.heappush(self._queue, (self.time + self.durations[part], part))

    def advance(self) -> list[tuple[str, Outcome]]:
        self.time = self._queue[0][0]
        ended = []
        while self._queue and self._queue[0][0] == self.time:
            _, part = heapq.heappop(self._queue)
            self.log.append((self.time, part))
            ended.append((part, self.act(part, self._targets.pop(part))))
        return ended
