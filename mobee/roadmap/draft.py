"""A map in the making: kept in a file every few seconds, and gone on with from there."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mobee.errors import MobeeError
from mobee.model import Model
from mobee.roadmap.archive import read, write
from mobee.roadmap.growth import Growth
from mobee.roadmap.neighbours import nearest, nearest_before, short, sorted_edges
from mobee.roadmap.request import digest
from mobee.roadmap.roadmap import Roadmap, digests, load_roadmap
from mobee.roadmap.told_world import world_told
from mobee.robot.robot import Array, Ints

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


class Draft:
    """Where a map that is asked for is kept, if anywhere, and who is told of it."""

    def __init__(
        self, model: Model, asked: dict[str, Any], spacing: Array, file: str | Path | None, progress: Callable[[Progress], None] | None
    ) -> None:
        self._model, self._asked, self._spacing, self._progress = model, asked, spacing, progress
        self._file = None if file is None else Path(file)
        self._digest = digest(asked)
        self._began = self._kept = time.monotonic()
        self._told = -np.inf
        self._found: tuple[dict[str, NDArray[Any]], dict[str, Any]] | None = None
        if self._file is not None and self._file.exists():
            self._found = read(self._file)
            self._require_same(self._found[1].get("settings", {}))

    def finished(self) -> Roadmap | None:
        """The map, if the file holds all of it."""
        if self._file is None or self._found is None or not self._found[1]["settings"].get("finished", False):
            return None
        return load_roadmap(self._file, self._model)

    def restore(self, growth: Growth) -> bool:
        """Let a growth go on where the file says it was; False: there is none."""
        if self._found is None:
            return False
        arrays, notes = self._found
        growth.restore({name.removeprefix(_OWN): value for name, value in arrays.items() if name.startswith(_OWN)})
        growth.rng.bit_generator.state = notes["generator"]
        growth.judge.problem.evaluations = notes["settings"]["evaluations"]
        self._began -= notes["settings"]["seconds"]
        return True

    def keep(self, growth: Growth) -> None:
        """Write it down if that is due, and tell of it."""
        evaluations = growth.judge.problem.evaluations
        if self._file is not None and time.monotonic() - self._kept >= EVERY:
            self._checkpoint(self._file, growth, evaluations)
        self.tell(len(growth.chart), evaluations, growth)

    def _checkpoint(self, file: Path, growth: Growth, evaluations: int) -> None:
        q, y = growth.q, growth.chart.places * self._spacing
        roadmap = Roadmap(self._model, q, y, self._edges(q, y, growth.chart.edges), self._spacing, self._settings(evaluations, False))
        own = {_OWN + name: value for name, value in growth.state().items()}
        self._write(file, roadmap, own, {"generator": growth.rng.bit_generator.state})
        self._kept = time.monotonic()

    def tell(self, vertices: int, evaluations: int, still: int | Growth, at_once: bool = False) -> None:
        """Call for progress, unless it was called just now."""
        now = time.monotonic()
        if self._progress is not None and (at_once or now - self._told >= TELL):
            self._told = now
            left = still.open if isinstance(still, Growth) else still
            self._progress(Progress(vertices, evaluations, left, now - self._began))

    def finish(self, q: Array, y: Array, evaluations: int, edges: Ints | None = None) -> Roadmap:
        """The whole map, and on disk where it is to be; raises MobeeError if robot and world are no longer those it was built for."""
        here = digests(self._model)
        if any(self._asked[what] != here[what] for what in here):
            made, now = (" ".join(which[f"{what}_digest"] for what in ("robot", "world")) for which in (self._asked, here))
            raise MobeeError(f"robot and world have changed while the map was built: {made}, now {now}. Build it anew.")
        self.tell(len(q), evaluations, 0, at_once=True)
        roadmap = Roadmap(self._model, q, y, self._edges(q, y, edges), self._spacing, self._settings(evaluations, True))
        if self._file is not None:
            self._write(self._file, roadmap, {}, {})
        return roadmap

    def _edges(self, q: Array, y: Array, found: Ints | None) -> Ints:
        count, longest = self._asked["neighbours"], self._asked["longest"]
        if count is not None:
            return short(q, nearest(y, self._spacing, count), longest)
        if found is None:
            return short(q, nearest_before(y, self._spacing, len(self._spacing)), longest)
        return short(q, sorted_edges(found), longest)

    def _settings(self, evaluations: int, finished: bool) -> dict[str, Any]:
        versions = {name: version(name) for name in ("mobee", "numpy")}
        seconds = time.monotonic() - self._began
        return self._asked | {"versions": versions, "evaluations": evaluations, "seconds": seconds, "finished": finished}

    def _write(self, file: Path, roadmap: Roadmap, own: dict[str, NDArray[Any]], notes: dict[str, Any]) -> None:
        arrays = {"q": roadmap.q, "y": roadmap.y, "edges": roadmap.edges, "spacing": roadmap.spacing}
        whole = {"settings": roadmap.settings, "world": world_told(self._model.world), "reaching": self._model.reaching}
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
