# SPDX-License-Identifier: Apache-2.0
"""Endurance test of the model: several threads edit one world while the model evaluates, and every evaluation is checked."""

from __future__ import annotations

import math
import os
import random
import threading
import time
import traceback
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from experiments.claims.ch2_model.model_throughput_threads import Box, MovingModel, Oscillator, fast_thread_switching, random_boxes
from experiments.kit.command_line import Progress
from experiments.kit.plots import new_figure
from experiments.kit.run_folder import Records
from mobee import InvalidValue, Model, World, load_robot
from mobee.model import Geometry, WorldObject, box
from mobee.model.core_tables import CODES, VOLUME, Volumes
from mobee.model.engine import ATTACHED, ATTACHED_GHOST, GHOST, OBSTACLE, TARGET, Snapshot
from mobee.model.pose import Pose
from mobee.model.world_object import Role
from mobee.robot.robot import Robot

ROBOT = "icub"
ENDURANCE = "endurance.csv"
ENDURANCE_COLUMNS = ("seconds", "evaluations", "edits", "objects", "resident_mb", "torn", "exceptions")
BURST, PAUSE = 20, 1e-2  # edits, then s of pause, since the checks in Python need time too
SAMPLE_PERIOD = 1.0  # s
REFERENCE_PERIOD = 50  # evaluations between two comparisons with a reference model
MAX_SLOPE = 0.5  # MB/min; one leaked snapshot in a thousand would be hundreds

OWN = (5, 30)  # least and largest number of objects of a thread
MAX_ATTACHED = 3  # of them at a time
SHARED = ("shared 0", "shared 1", "shared 2")  # objects that all threads edit
ROLES: tuple[Role, ...] = ("obstacle", "target", "ghost")
STEP, STEPS = 1e-3, 1000  # m, size and number of the steps of a thread's two witnesses, which then start again
POOL = 500

FREE = {"obstacle": OBSTACLE, "target": TARGET, "ghost": GHOST}
DEPTH_TOLERANCE = 1e-9  # m, between two evaluations of the same contact

WARM_UP = 0.2  # share of the time until caches and the allocator's arenas are full
MIN_SECONDS = 60.0  # s, shortest time for a slope


class Editor:
    """Edits a world at random from one thread: objects of its own, and objects that all threads share.

    It makes only valid edits of its own objects, so the world must accept all of them.  `edits`: number of edits.  `refused`: number of
    refused edits of shared objects; these refusals are allowed.  Two of its own objects, the witnesses, make the order of edits visible:
    the editor always moves the first one by a step, then the second.

    Args:
        world, robot: the world to edit, and the robot to whose links objects are attached.
        shipped: short name of the robot ("icub" or "katana"); the boxes are placed within reach of this robot.
        number: of the thread, from 0.
        seed: of the random edits.
    """

    def __init__(self, world: World, robot: Robot, shipped: str, number: int, seed: int) -> None:
        self.edits = self.refused = 0
        self._world, self._links, self._number = world, robot.links, number
        self._random = random.Random(f"{seed} {number}")
        self._boxes = random_boxes(np.random.default_rng([seed, number]), shipped, POOL)
        self._free: list[str] = []
        self._attached: list[str] = []
        self._made = self._step = 0
        for name in witnesses(number):
            world.add(name, box(0.05, 0.05, 0.05), position=self._witness_place())

    def edit(self) -> None:
        """Make one random edit, or move both witnesses (see `Editor`) by a step, one after the other."""
        kinds = (self._add, self._remove, self._move, self._role, self._attach, self._detach, self._step_witnesses, self._edit_shared)
        self._random.choices(kinds, weights=(4, 4, 8, 2, 1, 1, 4, 2))[0]()
        self.edits += 1

    def _add(self) -> None:
        if len(self._free) + len(self._attached) >= OWN[1]:
            return self._remove()
        name, new = f"{self._number}:{self._made}", self._box()
        self._world.add(name, new.shape, position=new.position, rotation=new.rotation, role=self._random.choice(ROLES))
        self._free.append(name)
        self._made += 1

    def _remove(self) -> None:
        names = self._free if self._random.random() < 0.8 or not self._attached else self._attached
        if len(self._free) + len(self._attached) <= OWN[0] or not names:
            return self._add()
        self._world.remove(names.pop(self._random.randrange(len(names))))

    def _move(self) -> None:
        if self._free:
            new = self._box()
            self._world.move(self._random.choice(self._free), position=new.position, rotation=new.rotation)

    def _role(self) -> None:
        names = self._free + self._attached
        if names:
            self._world.set_role(self._random.choice(names), self._random.choice(ROLES))

    def _attach(self) -> None:
        if self._free and len(self._attached) < MAX_ATTACHED:
            name = self._free.pop(self._random.randrange(len(self._free)))
            self._world.attach(name, self._random.choice(self._links))
            self._attached.append(name)

    def _detach(self) -> None:
        if self._attached:
            name = self._attached.pop(self._random.randrange(len(self._attached)))
            self._world.detach(name)
            self._free.append(name)

    def _step_witnesses(self) -> None:
        self._step = (self._step + 1) % STEPS
        for name in witnesses(self._number):
            self._world.move(name, position=self._witness_place())

    def _edit_shared(self) -> None:
        name, new = self._random.choice(SHARED), self._box()
        what = self._random.randrange(4)
        try:
            if what == 0:
                self._world.move(name, position=new.position, rotation=new.rotation)
            elif what == 1:
                self._world.set_role(name, self._random.choice(ROLES))
            elif what == 2:
                self._world.attach(name, self._random.choice(self._links))
            else:
                self._world.detach(name)
        except InvalidValue:  # attached by another thread, or by none
            self.refused += 1

    def _box(self) -> Box:
        return self._random.choice(self._boxes)

    def _witness_place(self) -> tuple[float, float, float]:
        return STEP * self._step, 0.0, 5.0 + self._number


def witnesses(number: int) -> tuple[str, str]:
    """Return the names of the two objects that thread `number` always moves one after the other."""
    return f"{number}:first", f"{number}:second"


def out_of_order(objects: Mapping[str, WorldObject], threads: int) -> str | None:
    """Check that the edits of each thread are seen in the order in which they were made.

    A thread moves the first of its two witnesses (see `witnesses`) always before the second.  `objects`: the objects of one snapshot of the
    world, by name.  `threads`: number of threads.  Returns a text that names the first thread with wrong order; None if all are right.
    """
    for number in range(threads):
        first, second = (round(objects[name].position[0] / STEP) for name in witnesses(number))
        if (first - second) % STEPS > 1:
            return f"thread {number}'s second edit is seen, its first is not: steps {first} and {second}"
    return None


class WatchedWorld(World):
    """A world that remembers the last snapshot that was read, in `seen`.

    If only one thread evaluates the model, this is the snapshot of its newest evaluation.
    """

    def __init__(self) -> None:
        super().__init__()
        self.seen = super().snapshot

    @property
    def snapshot(self) -> Snapshot:
        """The present snapshot of the world, as in `World.snapshot`.  It is also stored in `seen`."""
        self.seen = super().snapshot
        return self.seen


def torn_table(snapshot: Snapshot) -> str | None:
    """Return a text that names the first difference between the tables of a snapshot and its objects; None if they agree exactly.

    A snapshot is an unchanging copy of the world.  It is torn if its tables do not belong to its objects.  The compared tables are the
    names, the roles, the names of attached objects, and the rows that describe the volumes (shape, size and pose).  All objects must be
    boxes.
    """
    things = list(snapshot.objects.values())
    if not snapshot.names == tuple(snapshot.objects) == tuple(thing.name for thing in things):
        return "names are not those of the objects"
    roles = [FREE[t.role] if t.link is None else ATTACHED_GHOST if t.role == "ghost" else ATTACHED for t in things]
    if snapshot.roles.tolist() != roles:
        return "roles are not those of the objects"
    if sorted(snapshot.attached) != sorted(thing.name for thing in things if thing.link is not None):
        return "attached are not the objects with a link"
    if not np.array_equal(snapshot.rows, _rows_of_boxes(things)):
        return "rows are not those of the objects"
    return None


def _rows_of_boxes(boxes: list[WorldObject]) -> Volumes:
    """Compute the rows (N,) that boxes have in the core's table of volumes, independently of the code that is checked."""
    rows = np.zeros(len(boxes), dtype=VOLUME)
    if not boxes:
        return rows
    rows["kind"] = CODES["box"]
    rows["position"] = [box.position for box in boxes]
    rows["rotation"] = [box.rotation for box in boxes]
    rows["half"] = np.array([box.size for box in boxes]) / 2.0
    rows["bound"] = [math.hypot(*box.size) / 2.0 for box in boxes]
    return rows


def other_objects(pose: Pose, snapshot: Snapshot) -> str | None:
    """Return a text that says how the objects of an evaluation differ from those of its snapshot; None if they are the same.

    `pose`: the evaluation.  `snapshot`: the copy of the world that it used.  Objects that are attached to a link are compared by name only.
    """
    seen = pose.objects
    if tuple(seen) != snapshot.names:
        return "the evaluation has other names than its snapshot"
    other = [name for name, thing in snapshot.objects.items() if thing.link is None and seen[name] is not thing]
    return f"the evaluation has another {other[0]!r} than its snapshot" if other else None


class Reference:
    """A second model of the robot, which checks evaluations.

    For a check, a single thread rebuilds the world of this model from a snapshot.
    """

    def __init__(self, robot: Robot) -> None:
        self._model = Model(robot)

    def other_contacts(self, pose: Pose, snapshot: Snapshot) -> str | None:
        """Evaluate the same pose with a world that is rebuilt from the snapshot, and compare the contacts.

        Returns a text that names the differing contacts; None if all depths agree within DEPTH_TOLERANCE (1e-9 m).
        """
        world = self._model.world
        for name in world.objects:
            world.remove(name)
        for name, thing in snapshot.objects.items():
            world.add(name, Geometry(thing.kind, thing.size), position=thing.position, rotation=thing.rotation, role=thing.role)
            if thing.link is not None:
                world.attach(name, thing.link, (thing.position, thing.rotation))
        found, expected = _depths(pose), _depths(self._model.evaluate(pose.q))
        pairs = sorted(p for p in found.keys() | expected.keys() if not abs(found.get(p, 0.0) - expected.get(p, 0.0)) <= DEPTH_TOLERANCE)
        return f"{len(pairs)} contacts of the evaluation are not those of its snapshot: {pairs[:3]}" if pairs else None


def _depths(pose: Pose) -> dict[tuple[str, str, str], float]:
    return {(contact.first, contact.second, contact.kind): contact.depth for contact in pose.contacts}


def resident_mb() -> float | None:
    """Return the resident memory of this process [MB]; None on systems without /proc."""
    try:
        with open("/proc/self/statm", encoding="ascii") as file:
            pages = int(file.read().split()[1])
    except OSError:
        return None
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def slope_mb_per_minute(seconds: Sequence[float], megabytes: Sequence[float]) -> float | None:
    """Fit a line to measurements of the memory over time and return its slope [MB/min].

    `seconds`: times of the measurements since the start.  `megabytes`: the memory.  The first 20 % of the time (WARM_UP) is left out.
    Returns None if the remaining measurements cover less than MIN_SECONDS (60 s).
    """
    settled = [(t / 60.0, mb) for t, mb in zip(seconds, megabytes, strict=True) if t > WARM_UP * seconds[-1]]
    if not settled or (settled[-1][0] - settled[0][0]) * 60.0 < MIN_SECONDS:
        return None
    minutes, resident = np.transpose(settled)
    return float(np.polyfit(minutes, resident, 1)[0])


class Judge:
    """Checks every evaluation of the model, in the thread that made it.

    An evaluation is torn if it does not belong to one consistent state of the world.  `torn`: dict from the text of an error to how often
    it occurred.  `references`: number of evaluations that were compared with a second model, whose world is built anew.
    """

    def __init__(self, model: Model, world: WatchedWorld, threads: int) -> None:
        self.torn = Counter[str]()
        self.references = 0
        self._world, self._threads = world, threads
        self._reference = Reference(model.robot)
        self._evaluations = self._version = 0

    def check(self, pose: Pose) -> None:
        """Check an evaluation and count its errors in `torn`, a dict from the text of an error to how often it occurred.

        Every 50th evaluation (REFERENCE_PERIOD) is also compared with a reference model.
        """
        snapshot = self._world.seen
        self._evaluations += 1
        found = [torn_table(snapshot), other_objects(pose, snapshot), out_of_order(snapshot.objects, self._threads)]
        if snapshot.version < self._version:
            found.append("an evaluation saw an older world than the one before")
        self._version = snapshot.version
        if self._evaluations % REFERENCE_PERIOD == 0:
            self.references += 1
            found.append(self._reference.other_contacts(pose, snapshot))
        self.torn.update(text for text in found if text is not None)


class Endurance:
    """An endurance run: the world, the model of a moving robot, the checks of its evaluations, and an editor of the world for each thread.

    `exceptions`: dict from the traceback of an exception to how often it occurred.  `samples`: pairs of time [s] and resident memory [MB].
    """

    def __init__(self, threads: int, seed: int) -> None:
        self.world = WatchedWorld()
        model = Model(load_robot(ROBOT), self.world)
        oscillator = Oscillator(model.robot, np.random.default_rng(seed))
        self.world.follow(model.evaluate(oscillator.at(0.0)))  # before the first object is attached
        for name, shared in zip(SHARED, random_boxes(np.random.default_rng(seed), ROBOT, len(SHARED)), strict=True):
            self.world.add(name, shared.shape, position=shared.position, rotation=shared.rotation)
        self.editors = [Editor(self.world, model.robot, ROBOT, number, seed) for number in range(threads)]
        self.judge = Judge(model, self.world, threads)
        self.moving = MovingModel(model, oscillator, self.judge.check)
        self.exceptions = Counter[str]()
        self.samples: list[tuple[float, float]] = []  # s, MB

    @contextmanager
    def running(self) -> Iterator[None]:
        """Run all editing threads and the model inside this context manager."""
        end = threading.Event()
        crew = [threading.Thread(target=self._edit, args=(editor, end), daemon=True) for editor in self.editors]
        with fast_thread_switching(), self.moving:
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
        """Store the resident memory in `samples`, and return the present counts, a row of endurance.csv.

        `seconds`: time since the start.  Keys: "seconds"; the numbers of "evaluations", "edits", "objects", "torn" (errors that the checks
        found) and "exceptions"; "resident_mb", None on systems without /proc.
        """
        resident = resident_mb()
        if resident is not None:
            self.samples.append((seconds, resident))
        edits, torn = sum(editor.edits for editor in self.editors), self.judge.torn.total()
        counts = (self.moving.evaluations, edits, len(self.world.objects), resident, torn, self.exceptions.total())
        return dict(zip(ENDURANCE_COLUMNS, (round(seconds, 3), *counts), strict=True))

    def verdict(self) -> dict[str, Any]:
        """Return the counts and results of the run.

        "passed": whether there was an evaluation, the checks found no error, no exception was raised, and the memory grew by less than
        MAX_SLOPE (0.5 MB/min).  "torn": dict from the text of an error that the checks found to how often it occurred; the error means that
        an evaluation did not use one consistent state of the world.  "exceptions": dict from a traceback to how often it occurred.
        "slope_mb_per_minute": growth of the memory; None if the run was too short to measure it; then "passed" does not depend on it.
        "threads", "evaluations" and "edits": their numbers.  "compared_with_a_world_built_anew": number of evaluations that were compared
        with a second model.  "refused_as_they_must_be": number of refused edits of objects that the threads share; these refusals are
        allowed.  "resident_mb": dict of the "first" and "last" memory [MB]; None if it is not known.
        """
        slope = slope_mb_per_minute(*zip(*self.samples, strict=True)) if self.samples else None
        is_sound = not self.judge.torn and not self.exceptions and self.moving.evaluations > 0
        return {
            "passed": is_sound and (slope is None or slope < MAX_SLOPE),
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
        while not end.wait(PAUSE):
            for _ in range(BURST):
                try:
                    editor.edit()
                except Exception:  # counted, and reported with the verdict
                    self.exceptions[traceback.format_exc()] += 1


def endure(folder: Path, *, threads: int, duration: float, seed: int) -> dict[str, Any]:
    """Run the endurance test with `threads` editing threads for `duration` s, and return its counts and results.

    Keys: "seconds", the duration, and those of `Endurance.verdict`, among them "passed".  The run ends early if the model raises an
    exception.  A row per second is written to endurance.csv in `folder`; an older endurance.csv is deleted first.  `seed`: of the boxes,
    the edits and the motion.
    """
    path = folder / ENDURANCE
    path.unlink(missing_ok=True)  # an interrupted endurance run starts again
    run = Endurance(threads, seed)
    with Records(path, ENDURANCE_COLUMNS) as records, Progress() as progress, run.running():
        begin, seconds = time.perf_counter(), 0.0
        while seconds < duration and run.moving.error is None:
            time.sleep(min(SAMPLE_PERIOD, duration - seconds))
            seconds = time.perf_counter() - begin
            now = run.sample(seconds)
            records.append(now)
            progress.show(seconds / duration, ", ".join(f"{now[key]} {key}" for key in ("evaluations", "edits", "torn", "exceptions")))
    return {"seconds": round(seconds, 1), **run.verdict()}


def plot_endurance(records: Sequence[Mapping[str, str]]) -> Any:
    """Return a figure of the resident memory, and of the total numbers of edits and evaluations, over time."""
    drawing = new_figure(8.0, 5.0)
    above, below = drawing.subplots(2, 1, sharex=True)
    minutes = [float(record["seconds"]) / 60.0 for record in records]
    above.plot(minutes, [float(record["resident_mb"] or "nan") for record in records])
    above.set(ylabel="resident memory [MB]", title="Several threads edit the world while the model evaluates")
    above.set_ylim(0.0, 1.2 * above.get_ylim()[1])
    for column in ("edits", "evaluations"):
        below.plot(minutes, [int(record[column]) for record in records], label=column)
    below.set(xlabel="time [min]", ylabel="total", yscale="log")
    below.legend()
    return drawing
