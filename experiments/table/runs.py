"""The finished runs at the table, and what is counted in each."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
from numpy.typing import NDArray

from experiments.kit.arm_learning import ARM_NEIGHBOURS, LEFT, RANK3, RIGHT, arm_space, torso_space
from experiments.kit.cells import CellResult
from experiments.kit.outcomes import failure_shares, outcome_counts, tries_of
from experiments.table.touch import low_goals
from mobee import Lattice
from mobee.robot.robot import Array, Ints

TRANSITIONS = 18_000  # a learner
EXPLORERS, WORLDS = ("curious", "least_tried", "random"), ("table", "ghost")
ARMS = ("left_arm", "right_arm")
PARTS = ("torso", *ARMS)
FORWARD_STATES = slice(18, 27)  # of the torso: pitch at its third level
WINDOW = 50  # transitions of an arm, of the touch rate over time

Key = tuple[str, str, str]  # propagation, explorer, world


@cache
def spaces() -> dict[str, Lattice]:
    """Of each part; both arms have one graph."""
    arms = {arm: arm_space(RANK3, ARM_NEIGHBOURS, joints=joints) for arm, joints in zip(ARMS, (LEFT, RIGHT), strict=True)}
    return {"torso": torso_space(), **arms}


@cache
def low() -> NDArray[np.bool_]:
    """The arms' states (81,) below the table's top when the torso is bent, for both arms alike."""
    either: NDArray[np.bool_] = low_goals(ARMS[0]) | low_goals(ARMS[1])
    return either


@dataclass(frozen=True, eq=False)
class Run:
    """One run of three agents, see `experiments.table.work`."""

    result: CellResult

    @property
    def seed(self) -> int:
        """Of agents and encoders."""
        return self.result.cell.seed

    @cached_property
    def seen(self) -> dict[str, Ints]:
        """Each part's transitions, (T, 3)."""
        return {part: self.result.values[f"seen_{part}"].astype(np.intp) for part in PARTS}

    @cached_property
    def tries(self) -> dict[str, Ints]:
        """Of each part's actions, (S, A)."""
        return {part: tries_of(spaces()[part], seen) for part, seen in self.seen.items()}

    @cached_property
    def outcomes(self) -> dict[str, Ints]:
        """In how many states each action of a part ended, (S, A)."""
        return {part: outcome_counts(spaces()[part], seen) for part, seen in self.seen.items()}

    def of_arms(self, name: str) -> Array:
        """What was recorded of both arms' actions, (2, T)."""
        return np.array([self.result.values[f"{name}_{arm}"] for arm in ARMS])

    @cached_property
    def late(self) -> slice:
        """The second half of the transitions."""
        return slice(len(self.seen["torso"]) // 2, None)

    @property
    def touch(self) -> float:
        """The share of the arms' actions that ended touching, in the second half."""
        return float(self.of_arms("touch")[:, self.late].mean())

    @property
    def touch_rate(self) -> Array:
        """The same over time, in windows of so many transitions of each arm."""
        touch = self.of_arms("touch")
        count = touch.shape[1] // WINDOW
        rate: Array = touch[:, : count * WINDOW].reshape(2, count, WINDOW).mean(axis=(0, 2))
        return rate

    @property
    def growth(self) -> float:
        """By how much the touch rate of the last third exceeds that of the first."""
        touch = self.of_arms("touch")
        third = touch.shape[1] // 3
        return float(touch[:, -third:].mean() - touch[:, :third].mean())

    @property
    def torso_forward(self) -> float:
        """Tries of the torso's actions that lean forward over those of its others, means an action, in the second half."""
        tries = tries_of(spaces()["torso"], self.seen["torso"][self.late])
        goals = spaces()["torso"].goals
        forward = (goals >= FORWARD_STATES.start) & (goals < FORWARD_STATES.stop)
        return float(tries[forward].mean() / tries[~forward].mean())

    @property
    def low_and_forward(self) -> float:
        """The share of the arms' actions that aimed low and ended while the torso was bent, in the second half."""
        goals = np.array([spaces()[arm].goals[self.seen[arm][:, 0], self.seen[arm][:, 1]] for arm in ARMS])
        both = low()[goals] & self.of_arms("forward").astype(bool)
        return float(both[:, self.late].mean())

    @property
    def arms_low(self) -> float:
        """Tries of the arms' actions that aim low over those of the others, means an action, in the second half."""
        tries = np.sum([tries_of(spaces()[arm], self.seen[arm][self.late]) for arm in ARMS], axis=0)
        aims_low = low()[spaces()[ARMS[0]].goals]
        return float(tries[aims_low].mean() / tries[~aims_low].mean())

    @property
    def half_failing(self) -> int:
        """How many actions of both arms failed in 10 to 90 % of their tries."""
        shares = np.array([failure_shares(spaces()[arm], self.seen[arm]) for arm in ARMS])
        return int(((shares > 0.1) & (shares < 0.9)).sum())

    @property
    def timeouts(self) -> dict[str, float]:
        """Which share of a part's actions timed out."""
        return {part: float(1.0 - self.result.values[f"settled_{part}"].mean()) for part in PARTS}

    @property
    def hours(self) -> float:
        """Of the plant's time, until the slowest agent was done."""
        return float(max(self.result.values[f"ends_{part}"][-1] for part in PARTS)) / 3600.0


def runs_of(found: Mapping[str, CellResult]) -> dict[Key, list[Run]]:
    """The finished runs of each condition, in the order of the seeds."""
    grouped: dict[Key, list[Run]] = {}
    for result in sorted(found.values(), key=lambda one: one.cell.seed):
        chosen = result.cell.settings
        grouped.setdefault((chosen["propagate"], chosen["explorer"], chosen["world"]), []).append(Run(result))
    order = [(way, explorer, world) for way in ("tree", "part") for explorer in EXPLORERS for world in WORLDS]
    return {key: grouped[key] for key in order if key in grouped}


def with_ghosts(runs: Mapping[Key, list[Run]], way: str, explorer: str) -> list[tuple[Run, Run]]:
    """Each run at the table with the one of the same seed at the ghost."""
    ghosts = {run.seed: run for run in runs.get((way, explorer, "ghost"), [])}
    at_table: Iterable[Run] = runs.get((way, explorer, "table"), [])
    return [(run, ghosts[run.seed]) for run in at_table if run.seed in ghosts]
