# SPDX-License-Identifier: Apache-2.0
"""Motions for drawing: a sequence of poses, with the world's objects at each pose."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mobee.arrays import Array, Ints
from mobee.errors import InvalidValue
from mobee.model.model import Model
from mobee.model.pose import Pose
from mobee.model.world_object import WorldObject
from mobee.simulation.plant import OfflinePlant

MOVED = 0.02  # rad, or m: a motor that moves less counts as still
REST_SPEED = 0.002  # m/s: a pause counts as motion at this speed, so that it gets few of the moments shown


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """A sequence of T poses.

    `poses`: the T poses, at `times` (T,) s. `objects`: for each pose, the objects of the world by name.
    """

    poses: tuple[Pose, ...]
    times: Array
    objects: tuple[Mapping[str, WorldObject], ...]

    def __post_init__(self) -> None:
        """Check that there are as many times and objects as poses, and at least one; raise InvalidValue otherwise."""
        if not len(self.poses) == len(self.times) == len(self.objects) > 0:
            counts = f"{len(self.poses)} poses, {len(self.times)} times, {len(self.objects)} worlds"
            raise InvalidValue(f"a motion of {counts}: must be as many of each, at least one")

    def __len__(self) -> int:
        return len(self.poses)

    def part(self, first: int, last: int) -> Motion:
        """Return the motion from the pose with index `first` to the pose with index `last`, both included."""
        return Motion(self.poses[first : last + 1], self.times[first : last + 1], self.objects[first : last + 1])

    def path(self, marker: str) -> Array:
        """Return the positions of a marker in all poses, (T, 3) m, root frame; raise UnknownName if the robot has no such marker."""
        return np.array([pose.position(marker) for pose in self.poses])

    def moved(self) -> tuple[str, ...]:
        """Return the names of the parts of which at least one motor moves by more than 0.02 (rad or m)."""
        q = np.array([pose.q for pose in self.poses])
        moves = np.ptp(q, axis=0) > MOVED
        return tuple(name for name, part in self.poses[0].robot.parts.items() if moves[part.slice].any())

    def moments(self, marker: str, count: int) -> Ints:
        """Return the indices of up to `count` poses, from the first to the last, between which the marker moves about equal distances.

        They are the poses to draw in a filmstrip.
        """
        steps = np.linalg.norm(np.diff(self.path(marker), axis=0), axis=1) + REST_SPEED * np.diff(self.times)
        covered = np.concatenate([[0.0], np.cumsum(steps)])
        shares = np.linspace(0.0, covered[-1], count) if count > 1 else covered[-1:]
        return np.unique(np.abs(covered - shares[:, None]).argmin(axis=1))


def motion_through(model: Model, q: ArrayLike, times: Sequence[float] | None = None) -> Motion:
    """Return the motion through poses q (T, n) rad in the model's present world; attached objects move with their links.

    `times`: (T,) s; None: 0, 1, 2, ...
    """
    poses = tuple(model.evaluate(row) for row in np.atleast_2d(np.asarray(q, dtype=np.float64)))
    found = np.arange(len(poses), dtype=np.float64) if times is None else np.asarray(times, dtype=np.float64)
    return Motion(poses, found, tuple(pose.objects for pose in poses))


class Recording:
    """Keeps poses of an offline plant (a simulated robot): the pose when the recording is made, and the pose at each call of `add`."""

    def __init__(self, plant: OfflinePlant) -> None:
        self._plant = plant
        self._poses: list[Pose] = []
        self._times: list[float] = []
        self._objects: list[dict[str, WorldObject]] = []
        self.add(plant.time)

    def __len__(self) -> int:
        return len(self._poses)

    def add(self, time: float) -> None:
        """Add the plant's present pose at `time` [s]; nothing is added before the plant's first tick."""
        if (pose := self._plant.pose) is not None:
            self._poses.append(pose)
            self._times.append(time)
            self._objects.append(pose.objects)

    def motion(self) -> Motion:
        """Return the motion recorded so far, with times from 0; raise InvalidValue if no pose was recorded."""
        return Motion(tuple(self._poses), np.array(self._times) - self._times[:1], tuple(self._objects))


@contextmanager
def recorded(plant: OfflinePlant, step: float = 0.05) -> Iterator[Recording]:
    """Record an offline plant inside the `with` block, one pose every `step` seconds of simulated time.

    The recording replaces the callback that was set with `plant.every`; afterwards no callback is set.
    """
    recording = Recording(plant)
    plant.every(max(1, round(step / plant.dt)), recording.add)
    try:
        yield recording
    finally:
        plant.every(1, None)
