"""An unfinished roadmap on disk, its settings, and how building resumes."""

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
from mobee.roadmap.building.task import Task
from mobee.roadmap.graph import nearest, nearest_before, short
from mobee.roadmap.ik.problem import Problem
from mobee.roadmap.roadmap import Roadmap, digests, load_roadmap

_PROBES, _DIGITS = 8, 9  # poses by which costs and coordinates are known again, and digits that count


def request(model: Model, problem: Problem, task: Task, spacing: Array, others: Mapping[str, Any]) -> dict[str, Any]:
    """All that decides what the map will be."""
    return {
        **digests(model),
        "costs": list(problem.by_name),
        "names": list(task.names),
        "units": [one.unit for one in task.coordinates],
        "box": task.box.tolist(),
        "spacing": spacing.tolist(),
        "motors": [model.robot.motors[k] for k in problem.free],
        "start": problem.start.tolist(),
        "meaning": _meaning(problem, task),
        **others,
    }


def digest(asked: Mapping[str, Any]) -> str:
    """16 hex digits of a request."""
    return hashlib.sha256(json.dumps(asked, sort_keys=True).encode()).hexdigest()[:16]


def _meaning(problem: Problem, task: Task) -> str:
    """16 hex digits of what costs and coordinates say of some poses: functions have no other content that could be compared."""
    low, high = problem.limits.T
    drawn = np.random.default_rng(0).uniform(low, high, (_PROBES, len(low)))
    pose = problem.model.evaluate(np.concatenate([problem.start[None], problem.whole(drawn)]))
    said = [one.weight * one.residual(pose) for one in problem.terms] + [task.of(pose).ravel()]
    tolerances = [(one.weight, one.tolerance) for one in problem.terms]
    numbers = [f"{value:.{_DIGITS - 1}e}" for value in np.concatenate(said) + 0.0]
    return hashlib.sha256(json.dumps([tolerances, numbers]).encode()).hexdigest()[:16]


EVERY = 5.0  # s between two writings, at least; at most 10 s of work are lost
TELL = 0.1  # s between two reports of progress
_OWN = "front_"  # how the names of arrays begin that only the building needs


@dataclass(frozen=True, slots=True)
class Progress:
    """How far a map is: its vertices, poses evaluated, vertices that may still be searched from, and seconds at work."""

    vertices: int
    evaluations: int
    open: int
    seconds: float


class Stage(Protocol):
    """What finds vertices step by step; the same steps follow from the same state, generator and number of evaluations."""

    rng: np.random.Generator
    problem: Problem

    @property
    def vertices(self) -> int: ...  # noqa: D102

    @property
    def open(self) -> int: ...  # noqa: D102

    def step(self) -> bool: ...  # noqa: D102

    def state(self) -> dict[str, NDArray[Any]]:
        """With the vertices' "q" (V, n) rad and "y" (V, m)."""

    def restore(self, state: Mapping[str, NDArray[Any]]) -> None: ...  # noqa: D102


class Draft:
    """Where a map that is asked for is kept, if anywhere, and who is told of it.

    `stage`: the name of the stage that the file was left in; None: there is no file.
    """

    def __init__(
        self, model: Model, asked: dict[str, Any], spacing: Array, file: str | Path | None, progress: Callable[[Progress], None] | None
    ) -> None:
        self._model, self._asked, self._spacing, self._progress = model, asked, spacing, progress
        self._file = None if file is None else Path(file)
        self._digest = digest(asked)
        self._began = self._kept = time.monotonic()
        self._told = -np.inf
        self.stage: str | None = None
        self._found: tuple[dict[str, NDArray[Any]], dict[str, Any]] | None = None
        if self._file is not None and self._file.exists():
            self._found = read(self._file)
            self._require_same(self._found[1].get("settings", {}))
            self.stage = self._found[1].get("stage")

    def finished(self) -> Roadmap | None:
        """The map, if the file holds all of it."""
        if self._file is None or self._found is None or not self._found[1]["settings"].get("finished", False):
            return None
        return load_roadmap(self._file, self._model)

    def run(self, name: str, stage: Stage) -> None:
        """Take all steps of a stage, from where the file was left if that was in it."""
        if self._found is not None and self.stage == name:
            arrays, notes = self._found
            own = {key.removeprefix(_OWN): value for key, value in arrays.items() if key.startswith(_OWN)}
            stage.restore(own | {key: arrays[key] for key in ("q", "y")})
            stage.rng.bit_generator.state = notes["generator"]
            stage.problem.evaluations = notes["settings"]["evaluations"]
            self._began -= notes["settings"]["seconds"]
        while stage.step():
            if self._file is not None and time.monotonic() - self._kept >= EVERY:
                self._checkpoint(self._file, name, stage)
            if self._progress is not None and time.monotonic() - self._told >= TELL:
                self._tell(stage.vertices, stage.problem.evaluations, stage.open)

    def _checkpoint(self, file: Path, name: str, stage: Stage) -> None:
        state = stage.state()
        q, y = state.pop("q"), state.pop("y")
        settings = self._settings(stage.problem.evaluations, False)
        roadmap = Roadmap(self._model, q, y, self._edges(q, y), self._spacing, settings)
        own = {_OWN + key: value for key, value in state.items()}
        self._write(file, roadmap, own, {"generator": stage.rng.bit_generator.state, "stage": name})
        self._kept = time.monotonic()

    def _tell(self, vertices: int, evaluations: int, left: int) -> None:
        if self._progress is not None:
            self._told = time.monotonic()
            self._progress(Progress(vertices, evaluations, left, self._told - self._began))

    def finish(self, q: Array, y: Array, evaluations: int) -> Roadmap:
        """The whole map, and on disk where it is to be; raises MobeeError if robot and world are no longer those it was built for."""
        here = digests(self._model)
        if any(self._asked[what] != here[what] for what in here):
            made, now = (" ".join(which[f"{what}_digest"] for what in ("robot", "world")) for which in (self._asked, here))
            raise MobeeError(f"robot and world have changed while the map was built: {made}, now {now}. Build it anew.")
        self._tell(len(q), evaluations, 0)
        roadmap = Roadmap(self._model, q, y, self._edges(q, y), self._spacing, self._settings(evaluations, True))
        if self._file is not None:
            self._write(self._file, roadmap, {}, {})
        return roadmap

    def _edges(self, q: Array, y: Array) -> Ints:
        count, longest = self._asked["neighbours"], self._asked["longest"]
        joined = nearest_before(y, self._spacing, len(self._spacing)) if count is None else nearest(y, self._spacing, count)
        return short(q, joined, longest)

    def _settings(self, evaluations: int, finished: bool) -> dict[str, Any]:
        versions = {name: version(name) for name in ("mobee", "numpy")}
        seconds = time.monotonic() - self._began
        return self._asked | {"versions": versions, "evaluations": evaluations, "seconds": seconds, "finished": finished}

    def _write(self, file: Path, roadmap: Roadmap, own: dict[str, NDArray[Any]], notes: dict[str, Any]) -> None:
        arrays = {"q": roadmap.q, "y": roadmap.y, "edges": roadmap.edges, "spacing": roadmap.spacing}
        whole = {"settings": roadmap.settings, "world": world_as_json(self._model.world)}
        write(file, arrays | own, whole | notes)

    def _require_same(self, settings: dict[str, Any]) -> None:
        kept = {name: settings[name] for name in self._asked if name in settings}
        if digest(kept) == self._digest:
            return
        other = [name for name in self._asked if settings.get(name) != self._asked[name]]
        raise MobeeError(
            f"{self._file}: built with settings {digest(kept)}, and those asked for are {self._digest}: they differ in {', '.join(other)}"
            + "".join(f"; {name} {settings.get(name)}, now {self._asked[name]}" for name in other if name.endswith("_digest"))
            + ". Give another file, or ask for what it was built with."
        )
