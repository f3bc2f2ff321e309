"""What is drawn of a motion: poses one after the other, with the world as it was in each."""

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

STILL = 0.02  # rad, or m: a motor that moves less is still
SLOW = 0.002  # m/s: standing still counts as moving that fast, so that a pause is seen, but little


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """T poses and their times [s], (T,), with the objects of the world as they were in each, by name."""

    poses: tuple[Pose, ...]
    times: Array
    objects: tuple[Mapping[str, WorldObject], ...]

    def __post_init__(self) -> None:
        """Check; raises InvalidValue."""
        if not len(self.poses) == len(self.times) == len(self.objects) > 0:
            counts = f"{len(self.poses)} poses, {len(self.times)} times, {len(self.objects)} worlds"
            raise InvalidValue(f"a motion of {counts}: must be as many of each, at least one")

    def __len__(self) -> int:
        return len(self.poses)

    def part(self, first: int, last: int) -> Motion:
        """From one pose to another, both included."""
        return Motion(self.poses[first : last + 1], self.times[first : last + 1], self.objects[first : last + 1])

    def way(self, marker: str) -> Array:
        """Where a marker was, (T, 3) m in the root frame; raises UnknownName."""
        return np.array([pose.position(marker) for pose in self.poses])

    def moved(self) -> tuple[str, ...]:
        """The parts of which some motor moved."""
        q = np.array([pose.q for pose in self.poses])
        moves = np.ptp(q, axis=0) > STILL
        return tuple(name for name, part in self.poses[0].robot.parts.items() if moves[part.slice].any())

    def moments(self, marker: str, count: int) -> Ints:
        """Up to that many poses, the first and the last among them, between which the marker goes equally far, in order."""
        steps = np.linalg.norm(np.diff(self.way(marker), axis=0), axis=1) + SLOW * np.diff(self.times)
        gone = np.concatenate([[0.0], np.cumsum(steps)])
        shares = np.linspace(0.0, gone[-1], count) if count > 1 else gone[-1:]
        return np.unique(np.abs(gone - shares[:, None]).argmin(axis=1))


def motion_through(model: Model, q: ArrayLike, times: Sequence[float] | None = None) -> Motion:
    """Poses q (T, n) rad in the model's world of now, in which attached objects go with their links; `times`: 0, 1, 2, ... s if None."""
    poses = tuple(model.evaluate(row) for row in np.atleast_2d(np.asarray(q, dtype=np.float64)))
    found = np.arange(len(poses), dtype=np.float64) if times is None else np.asarray(times, dtype=np.float64)
    return Motion(poses, found, tuple(pose.objects for pose in poses))


class Recording:
    """Poses of a plant as they come, from where it is."""

    def __init__(self, plant: OfflinePlant) -> None:
        self._plant = plant
        self._poses: list[Pose] = []
        self._times: list[float] = []
        self._objects: list[dict[str, WorldObject]] = []
        self.note(plant.time)

    def __len__(self) -> int:
        return len(self._poses)

    def note(self, time: float) -> None:
        """Keep the plant's pose of now, if it has one."""
        if (pose := self._plant.pose) is not None:
            self._poses.append(pose)
            self._times.append(time)
            self._objects.append(pose.objects)

    def motion(self) -> Motion:
        """All that was kept so far; raises InvalidValue if nothing was."""
        return Motion(tuple(self._poses), np.array(self._times) - self._times[:1], tuple(self._objects))


@contextmanager
def recorded(plant: OfflinePlant, step: float = 0.05) -> Iterator[Recording]:
    """Record what a plant does meanwhile, a pose each `step` s; what it was to call before with `every`, it does not call any more."""
    recording = Recording(plant)
    plant.every(max(1, round(step / plant.dt)), recording.note)
    try:
        yield recording
    finally:
        plant.every(1, None)
