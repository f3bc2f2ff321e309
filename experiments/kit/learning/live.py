# SPDX-License-Identifier: Apache-2.0
"""Lets agents with the same settings learn on the offline plant and on the live system, and compares the outcomes of their actions.

The live system runs in lockstep: each tick waits for all services.  Its transitions are stored on disk as soon as they are made.  In this
module, a record is the transitions of one run.  The distance of two records is the total variation between the outcomes of a state-action,
averaged over the state-actions.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping, Sequence
from dataclasses import astuple, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.kit.cells import Cell, load_cells
from experiments.kit.learning.arm import LEFT, RIGHT, TORSO
from experiments.kit.learning.exploration import explore_together
from experiments.kit.live.launch import LaunchFailed, summary_of
from experiments.kit.plots import finish, new_figure
from mobee import CuriousAgent, Gains, Lattice, Model, MotorParameters, OfflinePlant, load_robot, load_world
from mobee.arrays import Array, Ints
from mobee.errors import InvalidValue
from mobee.plant import Plant
from mobee.robot.robot import Robot
from mobee.robot.writing import write_whole
from mobee.store import STORE, TransitionStore

ROBOT, GAINS, RATE = "icub", "published_2014", 50  # RATE in Hz
JOINTS = {"torso": TORSO, "left_arm": LEFT, "right_arm": RIGHT}
ROBOTS = {  # settings of robot_sim; the identified motor model was fitted to the PyBullet robot
    "pybullet": {"backend": "pybullet", "motors": "published"},
    "mujoco": {"backend": "mujoco", "motors": "published"},
    "kinematic": {"backend": "kinematic", "motors": "identified"},
}
OBSERVED = str(Path(STORE).with_suffix(".npz"))
PIECE = 200  # transitions of each part in one launch
_ACTION_TIME = 7.0  # s of robot time for an action, a little above the torso's mean at the table
_MAX_IDLE = 3  # launches in a row without a new transition

_SCENARIO = """# Written by an experiment.
title = "Learning on {robot}, to be compared with the offline plant"

[shared]
robot = "{model}"
world = "{world}"
gains = "{gains}"
seed = {seed}
mode = "lock"

[services.robot_sim]
backend = "{backend}"
motors = "{motors}"
rate = {rate}

[services.model]
[services.controller]
"""
_AGENT = """
[services.agent_{part}]
joints = {joints}
neighbours = {neighbours}
seed = {agent_seed}
run_dir = "{folder}"
transitions = {transitions}
"""


@dataclass(frozen=True, slots=True)
class Task:
    """A learning task.

    `world`: name or path of the world.  `neighbours`: number of actions of each state, by name of the part that learns.
    """

    world: str
    neighbours: Mapping[str, int]

    @property
    def parts(self) -> tuple[str, ...]:
        """The names of the parts that learn."""
        return tuple(self.neighbours)


TASKS = {
    "arms": Task(str(Path(__file__).with_name("empty.xml")), {"left_arm": 4, "right_arm": 4}),
    "table": Task("table", {"torso": 4, "left_arm": 4, "right_arm": 4}),
    "published": Task("table", {"torso": 8, "left_arm": 16, "right_arm": 16}),
}


def space(robot: Robot, task: Task, part: str) -> Lattice:
    """Return the lattice of a part, with three levels of each joint and as many neighbours as the task states."""
    return Lattice(robot, JOINTS[part], neighbours=task.neighbours[part])


def offline_plant(task: Task, seed: int) -> OfflinePlant:
    """Return a plant of the whole iCub in the world of the task, with the motor model that was identified on PyBullet.

    `seed`: seed of the encoders' noise.
    """
    model = Model(load_robot(ROBOT), load_world(task.world))
    return OfflinePlant(model, seed, Gains.named(GAINS), MotorParameters.identified(ROBOT), 1.0 / RATE)


def agents(task: Task, plant: Plant, seed: int) -> list[CuriousAgent]:
    """Return an agent for each part of the task, with the settings that the agents of the live system (`services.agents`) have.

    `seed`: of the agents.
    """
    return [CuriousAgent(space(plant.robot, task, part), plant, seed=seed) for part in task.parts]


def learn_offline(cell: Cell) -> dict[str, Any]:
    """Let the agents of a task learn on the offline plant, as one run of a sweep.

    `cell`: the run: its seed, and the settings `task` (name of a task) and `transitions` (number for each part).

    Returns for each part "seen_<part>": transitions (T, 3): state, action, state reached; and "touched_<part>": (T,), whether a transition
    ended in contact with an object of the world.
    """
    task, number = TASKS[cell.settings["task"]], cell.settings["transitions"]
    plant = offline_plant(task, cell.seed)
    logs = explore_together(agents(task, plant, cell.seed), plant, number)
    seen = {f"seen_{part}": np.array(log.seen[:number], dtype=np.int32) for part, log in logs.items()}
    return seen | {f"touched_{part}": np.array(list(map(bool, log.touched[:number]))) for part, log in logs.items()}


def learn_live(task: str, robot: str, seed: int, transitions: int, folder: Path, report: Callable[[int], None], piece: int = PIECE) -> None:
    """Let every part of a task make `transitions` transitions on a live robot; continues after an interrupted call.

    Args:
        task: name of the task: "arms", "table" or "published".
        robot: simulator of the robot: "pybullet", "mujoco" or "kinematic".
        seed: of the agents, the robot and its encoders.
        transitions: number for each part.
        folder: where the transitions, the scenario and the launches are stored.
        report: function that is called before each launch, with the number of transitions that the slowest part has made.
        piece: number of transitions of each part in one launch.

    Raises:
        LaunchFailed: a launch failed, or three launches in a row made no transition.
    """
    folder.mkdir(parents=True, exist_ok=True)
    idle = 0
    while (slowest := min((made := _made(folder, task)).values())) < transitions:
        report(slowest)
        more = min(transitions - slowest, piece)
        scenario = folder / "scenario.toml"
        # Each part makes the same number, even one that has enough: a part without work would end before the run begins.
        scenario.write_text(_scenario(task, robot, seed, {part: made[part] + more for part in made}, slowest, folder.resolve()))
        summary_of(str(scenario), ticks=round(_ACTION_TIME * RATE * more), runs=folder / "launches")
        idle = 0 if min(_made(folder, task).values()) > slowest else idle + 1
        if idle == _MAX_IDLE:
            raise LaunchFailed(f"{folder}: {_MAX_IDLE} launches in a row made no transition; see their logs in {folder / 'launches'}")


def observed(folder: Path, task: str, number: int | None = None) -> dict[str, Any]:
    """Return the first `number` transitions of each part of a task that `learn_live` stored in `folder`, or all if `number` is None.

    `task`: name of the task.

    Returns for each part "seen_<part>": transitions (T, 3): state, action, state reached; and "touched_<part>": (T,), whether a transition
    ended in contact with an object of the world.
    """
    values: dict[str, Any] = {}
    for part in TASKS[task].parts:
        with TransitionStore(folder / STORE, part, read_only=True) as store:
            made = store.load()[:number]
        values[f"seen_{part}"] = np.array([(one.s, one.a, one.s_next) for one in made], dtype=np.int32).reshape(-1, 3)
        values[f"touched_{part}"] = np.array([bool(one.touched) for one in made])
    return values


def keep_observed(folder: Path, task: str) -> None:
    """Write the transitions of a task that `learn_live` stored in `folder` to the file OBSERVED in it, small enough for a record."""
    content = io.BytesIO()
    np.savez_compressed(content, **observed(folder, task))
    write_whole(folder / OBSERVED, content.getvalue())


def _kept(folder: Path, task: str) -> dict[str, Any] | None:
    """Return the transitions of a task in a folder of `learn_live`, from its file OBSERVED or else its store; None if it has neither."""
    if (folder / OBSERVED).exists():
        with np.load(folder / OBSERVED) as arrays:
            return dict(arrays)
    return observed(folder, task) if (folder / STORE).exists() else None


def _made(folder: Path, task: str) -> dict[str, int]:
    """Return the number of transitions of each part in the store."""
    path = folder / STORE
    if not path.exists():
        return dict.fromkeys(TASKS[task].parts, 0)
    with TransitionStore(path, "", read_only=True) as store:
        return {part: len(store.load(part)) for part in TASKS[task].parts}


def _scenario(task: str, robot: str, seed: int, goals: Mapping[str, int], slowest: int, folder: Path) -> str:
    """Return the scenario of one launch as text in TOML.

    The seed of robot and encoders differs between launches, that of the agents does not.
    `goals`: number of transitions of each part, old ones included, at which its agent ends.  `slowest`: smallest number of transitions that
    a part has made; the seed of the robot is computed from it.  `folder`: where the agents store their transitions.
    """
    wanted = TASKS[task]
    text = _SCENARIO.format(
        robot=robot, model=ROBOT, world=wanted.world, gains=GAINS, rate=RATE, seed=1000 * seed + slowest, **ROBOTS[robot]
    )
    for part in wanted.parts:
        joints = str(list(JOINTS[part])).replace("'", '"')
        text += _AGENT.format(
            part=part, joints=joints, neighbours=wanted.neighbours[part], agent_seed=seed, folder=folder, transitions=goals[part]
        )
    return text


Counts = Mapping[str, Ints]  # by part: number of each outcome, (S, A, S)


@dataclass(frozen=True, slots=True)
class Distance:
    """The distance of two records (the transitions of two runs), over the state-actions that both records tried often enough."""

    variation: float
    """Mean over the compared state-actions of the total variation between their outcomes in both records, 0 to 1."""
    agree: float
    """Share of the compared state-actions that have the same most frequent outcome in both records."""
    compared: int
    """Number of compared state-actions: those that both records tried often enough."""


def counts_of(seen: Ints, space: Lattice) -> Ints:
    """Count the outcomes in transitions `seen` (T, 3), rows of state, action, state reached; returns (S, A, S)."""
    counts = np.zeros((*space.goals.shape, len(space)), dtype=np.intp)
    np.add.at(counts, tuple(np.asarray(seen, dtype=np.intp).T), 1)
    return counts


def variations(first: Ints, second: Ints, least: int) -> Array:
    """Return the total variation (S, A) of the outcomes in two tables of counts (S, A, S); NaN where one has fewer than `least` tries."""
    both = (first.sum(axis=-1) >= least) & (second.sum(axis=-1) >= least)
    apart: Array = np.where(both, 0.5 * np.abs(shares(first) - shares(second)).sum(axis=-1), np.nan)
    return apart


def shares(counts: Ints) -> Array:
    """Return the share of each outcome in the tries of its state-action, (S, A, S), from counts (S, A, S); 0 without tries."""
    found: Array = counts / np.maximum(counts.sum(axis=-1, keepdims=True), 1)
    return found


def distance(first: Counts, second: Counts, least: int) -> Distance:
    """Return the distance of two records of transitions, over all state-actions that have at least `least` tries in each record.

    `first`, `second`: counts of outcomes (S, A, S) by part.  If there are no such state-actions, `variation` and `agree` are NaN and
    `compared` is 0.
    """
    apart = np.concatenate([variations(first[part], second[part], least).ravel() for part in first])
    same = np.concatenate([(first[part].argmax(axis=-1) == second[part].argmax(axis=-1)).ravel() for part in first])
    both = np.isfinite(apart)
    if not both.any():
        return Distance(float("nan"), float("nan"), 0)
    return Distance(float(apart[both].mean()), float(same[both].mean()), int(both.sum()))


def mean(distances: Sequence[Distance]) -> Distance:
    """Return the mean of several distances, field by field; the mean of the field `compared` is rounded to an integer."""
    rows = np.array([(one.variation, one.agree, one.compared) for one in distances])
    variation, agree, compared = rows.mean(axis=0)
    return Distance(float(variation), float(agree), round(float(compared)))


@dataclass(frozen=True, slots=True, eq=False)
class Compared:
    """How far the outcomes of a task on each live robot, and in each offline run, are from those of other offline runs.

    `offline`: for each offline run, its distance from all other offline runs together.  `live`: mean distance of each live robot, by name:
    with each offline run left out in turn, the distance between the robot and the remaining offline runs together is computed; the mean
    of these distances is taken.
    """

    live: dict[str, Distance]
    offline: tuple[Distance, ...]
    counts: dict[str, Counts]
    """Counts of outcomes (S, A, S), by robot and part; under "offline" those of all offline runs together."""


def compared(folder: Path, task: str, least: int) -> Compared:
    """Compare the outcomes that the live robots and the offline runs recorded for a task in the folder of an experiment's run.

    `task`: "arms", "table" or "published".  `least`: only state-actions with at least this number of tries in both records are compared.
    Raises InvalidValue if fewer than two offline runs have finished.
    """
    results = [r for r in load_cells(folder).values() if r.cell.settings["task"] == task]
    if len(results) < 2:
        raise InvalidValue(
            f"{folder}: the task {task!r} has {len(results)} finished offline seeds, two are needed: continue with --resume."
        )
    robot, parts = load_robot(ROBOT), TASKS[task].parts
    spaces = {part: space(robot, TASKS[task], part) for part in parts}
    seeds = [{part: counts_of(result.values[f"seen_{part}"], spaces[part]) for part in parts} for result in results]
    together = {part: np.sum([seed[part] for seed in seeds], axis=0) for part in parts}
    without = [{part: together[part] - seed[part] for part in parts} for seed in seeds]
    offline = tuple(distance(seed, others, least) for seed, others in zip(seeds, without, strict=True))
    counts: dict[str, Counts] = {"offline": together}
    for name in ROBOTS:
        if (live := _kept(folder / task / name, task)) is not None:
            number = results[0].cell.settings["transitions"]
            counts[name] = {part: counts_of(live[f"seen_{part}"][:number], spaces[part]) for part in parts}
    apart = {name: mean([distance(counts[name], others, least) for others in without]) for name in counts if name in ROBOTS}
    return Compared(apart, offline, counts)


@dataclass(frozen=True, slots=True)
class Contacts:
    """Counts of a part's actions, by how they ended.

    `missed`: actions that did not reach their goals.  `touching`: actions that ended in contact with an object of the world.  `both`:
    actions that missed their goals and ended in contact.  `actions`: all actions.
    """

    missed: int
    touching: int
    both: int
    actions: int

    @classmethod
    def of(cls, space: Lattice, seen: Ints, touched: NDArray[np.bool_]) -> Contacts:
        """Return the counts of all actions together: how many missed their goals, ended in contact, or both.

        `seen`: transitions (T, 3), a row for each action: state, action, state reached.  An action misses if the state reached is not its
        goal in `space`.  `touched`: (T,), whether each action ended in contact with an object of the world.
        """
        missed = seen[:, 2] != space.goals[seen[:, 0], seen[:, 1]]
        return cls(int(missed.sum()), int(touched.sum()), int((missed & touched).sum()), len(seen))

    def __add__(self, other: Contacts) -> Contacts:
        """Return the counts of both objects together: each field is the sum of the two fields."""
        return Contacts(*(mine + others for mine, others in zip(astuple(self), astuple(other), strict=True)))


def contacts(folder: Path, task: str) -> dict[str, dict[str, Contacts]]:
    """Return how the actions of each part ended on each robot: a dict from the robot to a dict from the part to the counts.

    The robot "offline" stands for all offline runs together.  `folder`: folder of the experiment's run.  `task`: "arms", "table" or
    "published".
    """
    robot, found = load_robot(ROBOT), dict[str, dict[str, Contacts]]()
    results = [r.values for r in load_cells(folder).values() if r.cell.settings["task"] == task]
    results = [values for values in results if f"touched_{TASKS[task].parts[0]}" in values]  # earlier versions kept no contacts
    for part in TASKS[task].parts:
        own, every = space(robot, TASKS[task], part), Contacts(0, 0, 0, 0)
        for values in results:
            every += Contacts.of(own, values[f"seen_{part}"], values[f"touched_{part}"])
        found.setdefault("offline", {})[part] = every
        for name in ROBOTS:
            if (live := _kept(folder / task / name, task)) is not None:
                found.setdefault(name, {})[part] = Contacts.of(own, live[f"seen_{part}"], live[f"touched_{part}"])
    return found


def contact_rows(folder: Path, task: str) -> dict[str, dict[str, int]]:
    """Return how the actions of each part on each robot ended, as a table: a dict from the row title "robot, part" to a row.

    A row is a dict with four counts: all actions, those that missed their goals, those that ended in contact with an object, and both.
    """
    return {
        f"{robot}, {part}": {
            "actions": one.actions,
            "missed their goals": one.missed,
            "ended in contact with table or ball": one.touching,
            "both": one.both,
        }
        for robot, parts in contacts(folder, task).items()
        for part, one in parts.items()
    }


COLORS = {"pybullet": "tab:red", "mujoco": "tab:green", "kinematic": "tab:blue"}


def draw_distances(tasks: Mapping[str, Compared], least: int) -> Any:
    """Draw the distances of live robots and offline runs, and how often each action reached its goal: a row of three panels for each task.

    `tasks`: the comparison by the name of the task.  `least`: the third panel has only state-actions with at least this number of tries,
    both live and offline.  Returns a Matplotlib Figure.
    """
    drawing = new_figure(13.0, 4.2 * len(tasks))
    panels = drawing.subplots(len(tasks), 3, squeeze=False)
    for (variation, agree, goals), (task, found) in zip(panels, tasks.items(), strict=True):
        _dots(variation, found, "variation", f"{task}: mean total variation a state-action")
        _dots(agree, found, "agree", "share with the same most frequent outcome")
        _goals(goals, task, found, least)
    return drawing


def _dots(axes: Any, found: Compared, name: str, label: str) -> None:
    offline = [getattr(one, name) for one in found.offline]
    axes.plot(np.linspace(-0.15, 0.15, len(offline)), offline, "o", color="0.5", markersize=4)
    for place, (robot, one) in enumerate(found.live.items(), start=1):
        axes.plot([place], [getattr(one, name)], "D", color=COLORS[robot])
        axes.axhspan(min(offline), max(offline), color="0.5", alpha=0.08, linewidth=0.0)
    axes.set_xticks(range(1 + len(found.live)), ["offline,\none dot per seed", *found.live], fontsize=8)
    axes.set(xlim=(-0.5, len(found.live) + 0.5), ylim=(0.0, None) if name == "variation" else (None, 1.005), ylabel=label)
    axes.grid(alpha=0.2, axis="y")


def _goals(axes: Any, task: str, found: Compared, least: int) -> None:
    """Draw the share of tries in which an action reaches its goal, live against offline."""
    robot = load_robot(ROBOT)
    rng = np.random.default_rng(0)
    for name in (name for name in ROBOTS if name in found.live):
        pairs = []
        for part in TASKS[task].parts:
            goals = space(robot, TASKS[task], part).goals[..., None]
            live, offline = found.counts[name][part], found.counts["offline"][part]
            both = (live.sum(axis=-1) >= least) & (offline.sum(axis=-1) >= least)
            reach = [np.take_along_axis(shares(counts), np.maximum(goals, 0), axis=-1)[..., 0][both] for counts in (offline, live)]
            pairs.append(np.stack(reach, axis=1))
        points = np.concatenate(pairs)
        points = points + rng.uniform(-0.02, 0.02, points.shape)  # separates equal points
        axes.plot(*points.T, ".", color=COLORS[name], markersize=4, alpha=0.4, label=f"{name}: {len(points)} state-actions")
    axes.plot([0.0, 1.0], [0.0, 1.0], color="0.5", linewidth=0.8)
    finish(axes, legend=7, xlabel="share that reach their goal, offline", ylabel="live", aspect="equal")
