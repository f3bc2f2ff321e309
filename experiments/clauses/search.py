"""The search: random tries first, then variations of the worst of each clause; all that it knows is in a JSON file."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np

from experiments.control.arm_command import Command, as_numbers, from_numbers, random_command, vary
from experiments.control.arm_try import ARMS, Trial, try_commands
from mobee import Gains

RANDOM = 0.3  # of the tries
GENERATION = 100  # tries between two savings
BEST = 8  # commands kept of each clause
CLAUSES = 7  # of an arm


@dataclass
class Search:
    """Violations are degrees along the normal, the largest so far, negative inside."""

    gains: str
    forced: bool
    seed: int
    tries: int = 0
    worst: float = -360.0
    stop: float = 0.0  # deg/s, the fastest arrival at a hard stop
    by_clause: list[float] = field(default_factory=lambda: [-360.0] * CLAUSES)
    course: list[tuple[int, float]] = field(default_factory=list)  # tries, worst until then
    inside: list[float] = field(default_factory=lambda: [-360.0])  # the worst of each generation, attractors inside the joint box
    random: list[float] = field(default_factory=lambda: [-360.0])  # the worst of each generation that was random
    elite: list[list[tuple[float, list[float]]]] = field(default_factory=lambda: [[] for _ in range(CLAUSES)])
    worst_try: dict[str, list[float] | list[list[float]] | int] = field(default_factory=dict)  # commands, torso, seed, arm, clause


def load(path: Path) -> Search:
    """The search as it was kept."""
    return Search(**json.loads(path.read_text()))


def keep(path: Path, state: Search) -> None:
    """Save it; a kill leaves the file before or the file after."""
    beside = path.with_suffix(".new")
    beside.write_text(json.dumps(asdict(state)))
    beside.replace(path)


def search(state: Search, tries: int) -> Iterator[Search]:
    """Go on until so many tries are made; yields after every generation."""
    gains = Gains.named(state.gains)
    while state.tries < tries:
        rng = np.random.default_rng([state.seed, state.forced, state.tries])
        is_random = state.tries < RANDOM * tries
        state.inside.append(-360.0)
        if is_random:
            state.random.append(-360.0)
        for _ in range(min(GENERATION, tries - state.tries + 1) // len(ARMS)):
            commands = [random_command(rng, state.forced) if is_random else _next(rng, state) for _ in ARMS]
            torso, seed = rng.uniform(-1.0, 1.0, 3), int(rng.integers(2**31))
            _learn(state, try_commands(gains, commands, torso, seed), commands, torso.tolist(), seed, is_random)
        state.course.append((state.tries, state.worst))
        yield state


def _next(rng: np.random.Generator, state: Search) -> Command:
    """Every other time something about the clause that is violated most."""
    clause = int(np.argmax(state.by_clause)) if rng.random() < 0.5 else int(rng.integers(CLAUSES))
    known = state.elite[clause]
    one, other = (known[int(rng.integers(len(known)))][1] for _ in range(2))
    return vary(rng, from_numbers(one), from_numbers(other))


def _learn(state: Search, trial: Trial, commands: list[Command], torso: list[float], seed: int, is_random: bool) -> None:
    violations = np.rad2deg(trial.violations)
    for arm, command in enumerate(commands):
        state.tries += 1
        numbers = as_numbers(command)
        for clause, value in enumerate(violations[arm].tolist()):
            state.by_clause[clause] = max(state.by_clause[clause], value)
            known = state.elite[clause]
            if len(known) < BEST or value > known[-1][0]:
                known.append((value, numbers))
                known.sort(key=lambda entry: -entry[0])
                del known[BEST:]
        worst = float(violations[arm].max())
        if worst > state.worst:
            state.worst = worst
            told = [as_numbers(each) for each in commands]
            state.worst_try = {"commands": told, "torso": torso, "seed": seed, "arm": arm, "clause": int(violations[arm].argmax())}
        if command.is_inside:
            state.inside[-1] = max(state.inside[-1], worst)
        if is_random:
            state.random[-1] = max(state.random[-1], worst)
    state.stop = max(state.stop, float(np.rad2deg(trial.stop.max())))
