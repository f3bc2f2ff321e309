# SPDX-License-Identifier: Apache-2.0
"""Writes event files for TensorBoard: the learning curves of agents, and the numbers that trials return.

Each agent and each trial has its own folder below `tensorboard/`, which is one run in TensorBoard.  The learning curves have one step per
transition.
"""

from __future__ import annotations

import argparse
import importlib.util
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from mobee.errors import NotInstalled
from mobee.learning.learner import WATCHERS, CuriousLearner
from mobee.learning.record import model_from, space_from
from mobee.learning.space import Space
from mobee.learning.transitions import TransitionModel
from mobee.learning.value_iteration import PREDICTABLE_SHARE, PREDICTABLE_TRIES, probability_of, surprise_of
from mobee.robot.load import load_robot
from mobee.robot.robot import Robot
from mobee.store import STORE, Transition, TransitionStore

FOLDER, TRACKERS = "tensorboard", ("tensorboard",)
_FLUSH = 10  # s


def add_track(parser: argparse.ArgumentParser) -> None:
    """Add the option --track to the parser."""
    text = "write what agents learn as event files, into a folder `tensorboard` (extra `track`)"
    parser.add_argument("--track", choices=TRACKERS, help=text)


def require_tracker(name: str | None) -> None:
    """Raise NotInstalled if the option --track has a value (`name` is not None) and the package tensorboardX is not installed."""
    if name is not None and importlib.util.find_spec("tensorboardX") is None:
        raise NotInstalled('--track tensorboard needs the package tensorboardX, which is not installed: pip install "mobee[track]"')


class Scalars:
    """Writes an event file into `folder`, which is one run in TensorBoard; TensorBoard then ignores earlier event files of this folder."""

    def __init__(self, folder: Path) -> None:
        from tensorboardX import SummaryWriter

        self._writer = SummaryWriter(str(folder), flush_secs=_FLUSH, purge_step=0)

    def write(self, step: int, time: float | None = None, **values: float) -> None:
        """Write numbers at a step, each with its name; `time`: wall-clock time, s since 1970; None: now."""
        for name, value in values.items():
            self._writer.add_scalar(name, value, step, time)

    def close(self) -> None:
        """Write the remaining values, and close the file."""
        self._writer.close()


class LearningCurves:
    """Writes the learning curves of one agent, computed from its transitions, into an event file of TensorBoard.

    The curves are: reward: information gain [nats]; surprise: -ln of the probability that the agent gave to the outcome [nats]; tried:
    share of its state-actions that were tried; predictable: share of its state-actions that were tried at least twice and had the same
    outcome in at least 80 % of the tries; robot_time: total duration of all actions [s].
    """

    def __init__(self, scalars: Scalars, space: Space, model: TransitionModel) -> None:
        """`model`: a new transition model without observations, with the settings of the agent's model; the curves are computed with it."""
        self._scalars, self._model, self._every = scalars, model, space.state_actions
        self._outcomes: dict[tuple[int, int], Counter[int]] = {}
        self._predictable: set[tuple[int, int]] = set()
        self._seconds = 0.0

    def add(self, made: Transition, time: float | None = None) -> None:
        """Add the next transition of the agent; `time`: wall-clock time at which it was made, s since 1970; None: now."""
        surprise = surprise_of(probability_of(self._model, made.s, made.a, made.s_next))
        self._model.observe(made.s, made.a, made.s_next)
        self._seconds += made.duration
        tried = made.s, made.a
        ended = self._outcomes.setdefault(tried, Counter())
        ended[made.s_next] += 1
        alike = max(ended.values()) >= PREDICTABLE_SHARE * ended.total() and ended.total() >= PREDICTABLE_TRIES
        (self._predictable.add if alike else self._predictable.discard)(tried)
        shares = {"tried": len(self._outcomes) / self._every, "predictable": len(self._predictable) / self._every}
        self._scalars.write(made.n, time, reward=made.reward, surprise=surprise, robot_time=self._seconds, **shares)

    def close(self) -> None:
        """Write the remaining numbers, and close the event file."""
        self._scalars.close()


@contextmanager
def tracked(folder: Path) -> Iterator[None]:
    """Write the learning curves of all agents that learn in this process during a `with` statement, as event files of TensorBoard.

    The curves of an agent are written to `folder`/<body part of the agent>; further agents of the same part get -2, -3, ... appended.
    While an inner `tracked` is active, the outer one writes nothing.
    """
    curves: dict[CuriousLearner, LearningCurves] = {}
    parts = Counter[str]()

    def watch(agent: CuriousLearner, made: Transition) -> None:
        if agent not in curves:
            parts[agent.part] += 1
            name = agent.part if parts[agent.part] == 1 else f"{agent.part}-{parts[agent.part]}"
            curves[agent] = LearningCurves(Scalars(folder / name), agent.space, model_from(agent.space, agent.settings))
        curves[agent].add(made)

    before, WATCHERS[:] = WATCHERS[:], [watch]
    try:
        yield
    finally:
        WATCHERS[:] = before
        for one in curves.values():
            one.close()


def track_values(values: Mapping[str, Any], folder: Path) -> None:
    """Write the numbers among the values of a trial (values by name) as an event file in `folder`; other values are ignored."""
    numbers = {name: float(value) for name, value in values.items() if isinstance(value, int | float)}
    if numbers:
        scalars = Scalars(folder)
        scalars.write(0, **numbers)
        scalars.close()


def track_stores(run: Path, robot: Robot | None = None) -> None:
    """Write the curves of the agents whose transitions are in SQLite stores below the folder of a run, such as those of a live system.

    The event files are below `run`/tensorboard.  `robot`: the agents' robot; None: the robot is loaded by the name that
    the store has recorded, as by `mobee.robot.load.load_robot`.
    """
    for file in sorted(run.rglob(STORE)):
        with TransitionStore(file, "", read_only=True) as store:
            for part in store.agents():
                if "space" in (settings := store.settings(part)):
                    space = space_from(settings["space"], robot or load_robot(settings["space"]["robot"]))
                    _track_store(store, part, space, settings, run / FOLDER / file.parent.relative_to(run) / part)


def _track_store(store: TransitionStore, part: str, space: Space, settings: dict[str, Any], folder: Path) -> None:
    curves = LearningCurves(Scalars(folder), space, model_from(space, settings))
    for made, time in zip(store.load(part), store.times(part), strict=True):
        curves.add(made, time)
    curves.close()
