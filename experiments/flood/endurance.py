"""Several threads edit the world in every way while the model evaluates; every evaluation is checked."""

from __future__ import annotations

import threading
import time
import traceback
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from experiments.flood.boxes import random_boxes
from experiments.flood.editor import SHARED, Editor, out_of_order
from experiments.flood.memory import resident_mb, slope_mb_per_minute
from experiments.flood.tearing import Reference, WatchedWorld, other_objects, torn_table
from experiments.flood.threads import MovingModel, Oscillator, quick_hand_over
from experiments.kit.progress import Progress
from experiments.kit.records import Records
from mobee import Model, load_robot
from mobee.model import Pose

ROBOT = "icub"
RECORDS = "endurance.csv"
COLUMNS = ("seconds", "evaluations", "edits", "objects", "resident_mb", "torn", "exceptions")
BURST, BREATH = 20, 1e-2  # edits, then s: the checks, in Python, need their time as well
SAMPLE = 1.0  # s
REFERENCE_EVERY = 50  # evaluations
FLAT = 0.5  # MB/min: one leaked snapshot in a thousand would be hundreds


class Judge:
    """Looks at every evaluation, in the thread that made it."""

    def __init__(self, model: Model, world: WatchedWorld, threads: int) -> None:
        self.torn = Counter[str]()
        self.references = 0
        self._world, self._threads = world, threads
        self._reference = Reference(model.robot)
        self._evaluations = self._version = 0

    def look(self, pose: Pose) -> None:
        """Count what is wrong with an evaluation."""
        snapshot = self._world.seen
        self._evaluations += 1
        found = [torn_table(snapshot), other_objects(pose, snapshot), out_of_order(snapshot.objects, self._threads)]
        if snapshot.version < self._version:
            found.append("an evaluation saw an older world than the one before")
        self._version = snapshot.version
        if self._evaluations % REFERENCE_EVERY == 0:
            self.references += 1
            found.append(self._reference.other_contacts(pose, snapshot))
        self.torn.update(text for text in found if text is not None)


class Endurance:
    """The world, the model, its judge and the editors of one run, and what was counted so far."""

    def __init__(self, threads: int, seed: int) -> None:
        self.world = WatchedWorld()
        model = Model(load_robot(ROBOT), self.world)
        oscillator = Oscillator(model.robot, np.random.default_rng(seed))
        model.evaluate(oscillator.at(0.0))  # tells the world where the links are
        for name, shared in zip(SHARED, random_boxes(np.random.default_rng(seed), ROBOT, len(SHARED)), strict=True):
            self.world.add(name, shared.shape, position=shared.position, rotation=shared.rotation)
        self.editors = [Editor(self.world, model.robot, ROBOT, number, seed) for number in range(threads)]
        self.judge = Judge(model, self.world, threads)
        self.moving = MovingModel(model, oscillator, self.judge.look)
        self.exceptions = Counter[str]()
        self.samples: list[tuple[float, float]] = []  # s, MB

    @contextmanager
    def running(self) -> Iterator[None]:
        """While entered, all threads work."""
        end = threading.Event()
        crew = [threading.Thread(target=self._edit, args=(editor, end), daemon=True) for editor in self.editors]
        with quick_hand_over(), self.moving:
            for thread in crew:
                thread.start()
            try:
                yield
            finally:
                end.set()
                for thread in crew:
                    thread.join()
        if self.moving.error is not None:
            self.exceptions["".join(traceback.format_exception(self.moving.error))] += 1

    def sample(self, seconds: float) -> dict[str, Any]:
        """The counts now, a record."""
        resident = resident_mb()
        if resident is not None:
            self.samples.append((seconds, resident))
        edits, torn = sum(editor.edits for editor in self.editors), self.judge.torn.total()
        counts = (self.moving.evaluations, edits, len(self.world.objects), resident, torn, self.exceptions.total())
        return dict(zip(COLUMNS, (round(seconds, 3), *counts), strict=True))

    def verdict(self) -> dict[str, Any]:
        """What came out; `passed` if nothing was torn, nothing raised and the memory is flat."""
        slope = slope_mb_per_minute(*zip(*self.samples, strict=True)) if self.samples else None
        is_sound = not self.judge.torn and not self.exceptions and self.moving.evaluations > 0
        return {
            "passed": is_sound and (slope is None or slope < FLAT),
            "threads": len(self.editors),
            "evaluations": self.moving.evaluations,
            "compared_with_a_world_built_anew": self.judge.references,
            "edits": sum(editor.edits for editor in self.editors),
            "refused_as_they_must_be": sum(editor.refused for editor in self.editors),
            "torn": dict(self.judge.torn),
            "exceptions": dict(self.exceptions),
            "resident_mb": {"first": self.samples[0][1], "last": self.samples[-1][1]} if self.samples else None,
            "slope_mb_per_minute": slope,
        }

    def _edit(self, editor: Editor, end: threading.Event) -> None:
        while not end.wait(BREATH):
            for _ in range(BURST):
                try:
                    editor.edit()
                except Exception:  # counted, and told with the verdict
                    self.exceptions[traceback.format_exc()] += 1


def endure(folder: Path, *, threads: int, duration: float, seed: int) -> dict[str, Any]:
    """Let `threads` threads edit for `duration` s, a record a second in endurance.csv; returns the verdict."""
    path = folder / RECORDS
    path.unlink(missing_ok=True)  # an endurance that was broken off begins again
    run = Endurance(threads, seed)
    with Records(path, COLUMNS) as records, Progress() as progress, run.running():
        begin, seconds = time.perf_counter(), 0.0
        while seconds < duration and run.moving.error is None:
            time.sleep(min(SAMPLE, duration - seconds))
            seconds = time.perf_counter() - begin
            now = run.sample(seconds)
            records.append(now)
            progress.show(seconds / duration, ", ".join(f"{now[key]} {key}" for key in ("evaluations", "edits", "torn", "exceptions")))
    return {"seconds": round(seconds, 1), **run.verdict()}
