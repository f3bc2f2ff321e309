"""The finished runs at the table, the counts of each, and the touch of an arm by geometry.

Touch is computed from poses alone, alike of tables that exert forces and of ghosts.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from itertools import product

import numpy as np
from numpy.typing import NDArray

from experiments.kit.cells import CellResult
from experiments.kit.learning.arm import ARM_NEIGHBOURS, LEFT, RANK3, RIGHT, TORSO, arm_space, robot, table_world, torso_space
from experiments.kit.learning.outcomes import goals_of, outcome_counts, tries_of, uncertain_in
from experiments.kit.sweep import Cells, grouped_by
from mobee import Lattice, Model, World, box
from mobee.arrays import Array, Ints
from mobee.model.contact import links_moved

PROPAGATIONS = ("tree", "part")  # contact forces reach the whole tree, or end at the root of a part
EXPLORERS, WORLDS = ("curious", "least_tried", "random"), ("table", "ghost")
JOINTS = {"left_arm": LEFT, "right_arm": RIGHT}
ARMS = tuple(JOINTS)
PARTS = ("torso", *ARMS)
FORWARD_STATES = slice(18, 27)  # of the torso: pitch at its third level
WINDOW = 50  # transitions of an arm, of the touch rate over time
NEAR = 0.02  # m between a field and the table's surface (paper, fig. 8: hand or elbow "within 2 cm of the table")
FORWARD = np.deg2rad(30.0)  # of torso pitch
BATCH = 2000  # poses


@cache
def spaces() -> dict[str, Lattice]:
    """The lattice of each part; both arms have one graph."""
    return {"torso": torso_space(), **{arm: arm_space(RANK3, ARM_NEIGHBOURS, joints=joints) for arm, joints in JOINTS.items()}}


@cache
def low() -> NDArray[np.bool_]:
    """The arms' states (81,) below the table's top when the torso is bent, for both arms alike."""
    either: NDArray[np.bool_] = low_goals(ARMS[0]) | low_goals(ARMS[1])
    return either


def world_around(margin: float) -> World:
    """The table, larger by a margin [m] on every side."""
    table = table_world().objects["table"]
    larger = World()
    size = [edge + 2.0 * margin for edge in table.size]
    larger.add("table", box(*size), position=table.position, rotation=table.rotation)
    return larger


def near_table(q: Array, arm: str, margin: float = NEAR) -> NDArray[np.bool_]:
    """In which poses q (N, n) rad a field of the arm is nearer to the table than the margin [m], (N,)."""
    model, moved = Model(robot(), world_around(margin)), np.array(sorted(links_moved(robot())[arm]))
    near = np.zeros(len(q), dtype=bool)
    for first in range(0, len(q), BATCH):
        table = model.evaluate(q[first : first + BATCH]).table
        rows = (table.second_link < 0) & (table.kind == 1) & np.isin(table.first_link, moved)
        near[first + table.pose[rows]] = True
    return near


def low_goals(arm: str) -> NDArray[np.bool_]:
    """Which states (81,) of an arm lie below the table's top when the torso is bent forward (75 % of its range)."""
    space, pitch = arm_space(joints=JOINTS[arm]), robot().motor_index(TORSO[2])
    q = np.tile(robot().home, (len(space), 1))
    low, high = robot().limits[pitch]
    q[:, pitch] = low + RANK3[-1] * (high - low)
    q[:, robot().part(arm).slice] = [space.target(state) for state in range(len(space))]
    return near_table(q, arm, 0.0)


def is_forward(q: Array) -> NDArray[np.bool_]:
    """In which poses q (N, n) rad the torso is bent forward, (N,)."""
    bent: NDArray[np.bool_] = q[:, robot().motor_index(TORSO[2])] > FORWARD
    return bent


@dataclass(frozen=True, eq=False)
class Run:
    """One run of three agents; see the trial of `table-discovery`."""

    result: CellResult

    @property
    def seed(self) -> int:
        """The seed of agents and encoders."""
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

    @cached_property
    def outcome_numbers(self) -> Ints:
        """In how many states the actions ended that were tried, of all parts together."""
        every = np.concatenate([self.outcomes[part].ravel() for part in PARTS])
        return every[every > 0]

    def of_arms(self, name: str) -> Array:
        """A recorded array of both arms' actions, (2, T)."""
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
        """The share of actions that ended touching over time, in windows of WINDOW transitions of each arm."""
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
        goals = np.array([goals_of(spaces()[arm], self.seen[arm]) for arm in ARMS])
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
        return sum(uncertain_in(spaces()[arm], self.seen[arm]) for arm in ARMS)

    @property
    def timeouts(self) -> dict[str, float]:
        """The share of a part's actions that timed out."""
        return {part: float(1.0 - self.result.values[f"settled_{part}"].mean()) for part in PARTS}

    @property
    def hours(self) -> float:
        """Hours of the plant's time until the slowest agent was done."""
        return float(max(self.result.values[f"ends_{part}"][-1] for part in PARTS)) / 3600.0


Runs = Mapping[tuple[str, str, str], list[Run]]  # propagation, explorer, world


def runs_of(found: Cells) -> Runs:
    """The finished runs of each condition, by seed, in the order of the conditions."""
    grouped = grouped_by(found, "propagate", "explorer", "world")
    return {key: [Run(result) for result in grouped[key]] for key in product(PROPAGATIONS, EXPLORERS, WORLDS) if key in grouped}


def with_ghosts(runs: Runs, propagate: str, explorer: str) -> list[tuple[Run, Run]]:
    """Each run at the table with the one of the same seed at the ghost."""
    ghosts = {run.seed: run for run in runs.get((propagate, explorer, "ghost"), [])}
    return [(run, ghosts[run.seed]) for run in runs.get((propagate, explorer, "table"), []) if run.seed in ghosts]
