"""The right arm that reaches, its states, and what it has learned of its transitions before (thesis 8.3)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

from experiments.kit.arm_learning import DT, RANK3, RIGHT, arm_space, robot
from experiments.kit.exploration import begin_anywhere, explore
from mobee import CuriousAgent, Gains, Lattice, Model, OfflinePlant
from mobee.learning.value_iteration import OutcomeModel
from mobee.reach import Aim

PART, MARKER = "right_arm", "right_palm"
LEARNED = 3000  # curious transitions, after which the lattice was known (thesis 7.2.2: 2987)


@dataclass(frozen=True)
class Law:
    """Under which gains the arm moves, and what it is to bring to the target: the palm to its "centre" or its "surface"."""

    gains: Gains
    dt: float
    aim: Aim


@cache
def laws() -> dict[str, Law]:
    """The published law, whose reaches pull against the attractor; and ours, whose reaches go all the way."""
    return {"published": Law(Gains.published_2014(), DT, "centre"), "default": Law(Gains.default(), 0.01, "surface")}


@cache
def reach_space() -> Lattice:
    """81 states of the right arm's four joints, with equidistant neighbours: 432 actions."""
    return arm_space(RANK3, joints=RIGHT)


def reach_plant(seed: int, law: str = "published") -> OfflinePlant:
    """The four motors of the right arm, in an empty world."""
    chosen = laws()[law]
    return OfflinePlant(Model(robot()), seed, chosen.gains, dt=chosen.dt, active=RIGHT)


def learned_beliefs(plant: OfflinePlant, seed: int, transitions: int = LEARNED) -> OutcomeModel:
    """What a curious agent learns of the transitions while no target is there; it is not changed by reaching (thesis 8.1)."""
    space = reach_space()
    begin_anywhere(space, plant, seed)
    agent = CuriousAgent(space, plant, seed=seed)
    explore(agent, transitions)
    return agent.model.debiased()
