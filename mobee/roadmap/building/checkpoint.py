# SPDX-License-Identifier: Apache-2.0
"""Saves an unfinished roadmap with its settings, and resumes building from the file."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from mobee.arrays import Array, Ints
from mobee.errors import MobeeError
from mobee.model.model import Model
from mobee.roadmap.archive import read, world_as_json, write
from mobee.roadmap.building.tasks import Coordinate, Task
from mobee.roadmap.graph import nearest, nearest_before, short
from mobee.roadmap.ik.problem import Problem
from mobee.roadmap.roadmap import Roadmap, digests, load_roadmap
from mobee.robot.motor_units import unit_name
from mobee.robot.robot import Robot

_PROBES, _DIGITS = 8, 9  # poses that identify costs and coordinates by their values, and significant digits of these


def request(model: Model, problem: Problem, task: Task, spacing: Array, others: Mapping[str, Any]) -> dict[str, Any]:
    """Return all settings that determine the roadmap, as plain JSON values.

    `spacing`: (m,) distance between vertices in each task coordinate. `others`: further settings by name, added to the result unchanged.
    """
    return {
        **digests(model),
        "costs": list(problem.by_name),
        "names": list(task.names),
        "units": [_unit(model.robot, one) for one in task.coordinates],
        "box": task.box.tolist(),
        "spacing": spacing.tolist(),
        "motors": [model.robot.motors[k] for k in problem.free],
        "start": problem.start.tolist(),
        "meaning": _meaning(problem, task),
        **others,
    }


def _unit(robot: Robot, coordinate: Coordinate) -> str:
    """Return the unit of a coordinate; that of a motor's position is only known with the robot: a slide has m."""
    if coordinate.unit == "rad" and coordinate.name in robot.motors:
        return unit_name(robot, robot.motor_table[robot.motor_index(coordinate.name)])
    return coordinate.unit


def digest(requested: Mapping[str, Any]) -> str:
    """Return a hash (16 hex digits) of the settings `requested`, as `request` returns them."""
    return hashlib.sha256(json.dumps(requested, sort_keys=True).encode()).hexdigest()[:16]


def _meaning(problem: Problem, task: Task) -> str:
    """Return 16 hex digits of the values of costs and coordinates in a few poses, since functions can only be compared by values."""
    low, high = problem.limits.T
    drawn = np.random.default_rng(0).uniform(low, high, (_PROBES, len(low)))
    pose = problem.model.evaluate(np.concatenate([problem.start[None], problem.whole(drawn)]))
    values = [one.weight * one.residual(pose) for one in problem.terms] + [task.of(pose).ravel()]
    tolerances = [(one.weight, one.tolerance) for one in problem.terms]
    numbers = [f"{value:.{_DIGITS - 1}e}" for value in np.concatenate(values) + 0.0]
    return hashlib.sha256(json.dumps([tolerances, numbers]).encode()).hexdigest()[:16]


SAVE_PERIOD = 5.0  # s between two writings, at least; at most 10 s of work are lost
PROGRESS_PERIOD = 0.1  # s between two reports of progress
_PREFIX = "front_"  # of the names of arrays that only the building needs


@dataclass(frozen=True, slots=True)
class Progress:
    """Progress of building a roadmap.

    `vertices`: number of vertices found. `evaluations`: number of poses evaluated. `open`: amount of work left:
    during least squares, the number of lattice points still to be tried; during the evolution strategy, the number of vertices from which a
    search may still start. `seconds`: time spent, in s.
    """

    vertices: int
    evaluations: int
    open: int
    seconds: float


class Builder(Protocol):
    """The interface of a builder, which finds the vertices of a roadmap step by step.

    `problem`: the costs of a pose, and the motors that may move; `problem.evaluations` is the number of evaluated poses. Steps are
    deterministic: they depend only on the builder's state, the state of its generator `rng`, and `problem.evaluations`.
    """

    rng: np.random.Generator
    problem: Problem

    @property
    def vertices(self) -> int:
        """Number of vertices found so far."""

    @property
    def open(self) -> int:
        """Amount of work left, as a number of points or vertices.

        Least squares: lattice points that are still to be tried. Evolution strategy: vertices from which a search may still start.
        """

    def step(self) -> bool:
        """Search for further vertices; return False if there is nothing left to try."""

    def state(self) -> dict[str, NDArray[Any]]:
        """Return the state as arrays by name; "q" (V, n) rad and "y" (V, m) are the poses and task coordinates of the vertices."""

    def restore(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Continue from `state`, which the method `state` of a builder with the same settings has returned."""


class Checkpoint:
    """Runs the builders of a roadmap, saves their state to a file, and reports progress.

    The attribute `stage` states which builder wrote the unfinished roadmap in `file`: "flood" (lattice) or "front" (evolution strategy). It
    is None if there is no such file, or if the file holds a finished roadmap.

    Args:
        model: robot and world.
        requested: all settings of the roadmap, as `request` returns them.
        spacing: (m,) distance between vertices in each task coordinate.
        file: the .npz file; None: nothing is saved.
        progress: called at most ten times per second; None: no reports.

    Raises:
        MobeeError: the file was built with other settings, or is damaged.
    """

    def __init__(
        self, model: Model, requested: dict[str, Any], spacing: Array, file: str | Path | None, progress: Callable[[Progress], None] | None
    ) -> None:
        self._model, self._requested, self._spacing, self._progress = model, requested, spacing, progress
        self._file = None if file is None else Path(file)
        self._digest = digest(requested)
        self._began = self._saved = time.monotonic()
        self._reported = -np.inf
        self.stage: str | None = None
        self._found: tuple[dict[str, NDArray[Any]], dict[str, Any]] | None = None
        if self._file is not None and self._file.exists():
            self._found = read(self._file)
            self._require_same(self._found[1].get("settings", {}))
            self.stage = self._found[1].get("stage")

    def finished(self) -> Roadmap | None:
        """Return the roadmap if the file holds a finished one, else None."""
        if self._file is None or self._found is None or not self._found[1]["settings"].get("finished", False):
            return None
        return load_roadmap(self._file, self._model)

    def run(self, name: str, builder: Builder) -> None:
        """Run all steps of a builder; `name`: name of the builder's stage, "flood" or "front" (see `stage`).

        If `stage` is equal to `name`, the file holds an earlier state of this builder, and the builder continues from it.
        """
        if self._found is not None and self.stage == name:
            arrays, notes = self._found
            state = {key.removeprefix(_PREFIX): value for key, value in arrays.items() if key.startswith(_PREFIX)}
            builder.restore(state | {key: arrays[key] for key in ("q", "y")})
            builder.rng.bit_generator.state = notes["generator"]
            builder.problem.evaluations = notes["settings"]["evaluations"]
            self._began -= notes["settings"]["seconds"]
        while builder.step():
            if self._file is not None and time.monotonic() - self._saved >= SAVE_PERIOD:
                self._save(self._file, name, builder)
            if self._progress is not None and time.monotonic() - self._reported >= PROGRESS_PERIOD:
                self._report(builder.vertices, builder.problem.evaluations, builder.open)

    def _save(self, file: Path, name: str, builder: Builder) -> None:
        state = builder.state()
        q, y = state.pop("q"), state.pop("y")
        settings = self._settings(builder.problem.evaluations, False)
        roadmap = Roadmap(self._model, q, y, self._edges(q, y), self._spacing, settings)
        extra = {_PREFIX + key: value for key, value in state.items()}
        self._write(file, roadmap, extra, {"generator": builder.rng.bit_generator.state, "stage": name})
        self._saved = time.monotonic()

    def _report(self, vertices: int, evaluations: int, open: int) -> None:
        if self._progress is not None:
            self._reported = time.monotonic()
            self._progress(Progress(vertices, evaluations, open, self._reported - self._began))

    def finish(self, q: Array, y: Array, evaluations: int) -> Roadmap:
        """Return the finished roadmap and save it to the .npz file, if one was given.

        `q`: (V, n) rad, poses. `y`: (V, m) task coordinates. `evaluations`: number of evaluated poses. Raises MobeeError if the robot or
        the world has changed since the start of the building.
        """
        here = digests(self._model)
        if any(self._requested[key] != here[key] for key in here):
            made, now = (" ".join(one[f"{key}_digest"] for key in ("robot", "world")) for one in (self._requested, here))
            raise MobeeError(f"the robot or the world has changed while the map was built: {made}, now {now}. Build it again.")
        self._report(len(q), evaluations, 0)
        roadmap = Roadmap(self._model, q, y, self._edges(q, y), self._spacing, self._settings(evaluations, True))
        if self._file is not None:
            self._write(self._file, roadmap, {}, {})
        return roadmap

    def _edges(self, q: Array, y: Array) -> Ints:
        count, longest = self._requested["neighbours"], self._requested["longest"]
        joined = nearest_before(y, self._spacing, len(self._spacing)) if count is None else nearest(y, self._spacing, count)
        return short(q, joined, longest)

    def _settings(self, evaluations: int, finished: bool) -> dict[str, Any]:
        versions = {name: version(name) for name in ("mobee", "numpy")}
        seconds = time.monotonic() - self._began
        return self._requested | {"versions": versions, "evaluations": evaluations, "seconds": seconds, "finished": finished}

    def _write(self, file: Path, roadmap: Roadmap, extra: dict[str, NDArray[Any]], notes: dict[str, Any]) -> None:
        arrays = {"q": roadmap.q, "y": roadmap.y, "edges": roadmap.edges, "spacing": roadmap.spacing}
        common = {"settings": roadmap.settings, "world": world_as_json(self._model.world)}
        write(file, arrays | extra, common | notes)

    def _require_same(self, settings: dict[str, Any]) -> None:
        kept = {name: settings[name] for name in self._requested if name in settings}
        if digest(kept) == self._digest:
            return
        other = [name for name in self._requested if settings.get(name) != self._requested[name]]
        raise MobeeError(
            f"{self._file}: built with settings {digest(kept)}, the requested ones are {self._digest}: they differ in {', '.join(other)}"
            + "".join(f"; {name} {settings.get(name)}, now {self._requested[name]}" for name in other if name.endswith("_digest"))
            + ". Give another file, or the settings of this one."
        )
