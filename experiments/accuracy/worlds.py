"""The worlds in which models are learnt, and what is true of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache

import numpy as np

from experiments.kit.arm_learning import RANK3, RANK4, arm_plant, arm_space
from experiments.kit.cells import CellResult
from experiments.kit.truth import truth_of
from mobee import Lattice, Plant
from mobee.learning.explorers import EXPLORERS
from mobee.learning.tabular import TabularPlant, half_space
from mobee.learning.value_iteration import OutcomeModel


@dataclass(frozen=True)
class World:
    """Where models are learnt, by whom, and for how long.  `tries`: of each action in each walk; 0: the truth is a table."""

    text: str
    levels: tuple[float, ...]
    explorers: tuple[str, ...]
    transitions: int
    tries: int = 0


WORLDS = {
    "half-space": World("half-space, 81 states", RANK3, tuple(name for name in EXPLORERS if name != "nearest_untried"), 4000),
    "rank3": World("arm, 81 states", RANK3, ("curious", "least_tried", "random"), 4000, tries=40),
    "rank4": World("arm, 256 states", RANK4, ("curious", "least_tried", "depleting"), 8000, tries=20),
}
WALKS = (9001, 9002)  # seeds that no explorer has


@cache
def space_of(world: str) -> Lattice:
    """The lattice of a world, with equidistant neighbours."""
    return arm_space(WORLDS[world].levels)


def plant_of(world: str) -> Callable[[int], Plant]:
    """What makes the world's plant of a seed."""
    return arm_plant if WORLDS[world].tries else half_space_plant


def half_space_plant(seed: int) -> TabularPlant:
    """The half-space in which states 24, 51 and 78 are cut off."""
    space = space_of("half-space")
    return TabularPlant(space, *half_space(space), seed)


def truths(found: Mapping[str, CellResult]) -> dict[str, OutcomeModel]:
    """The truth of each world that has one: the half-space's own table, the arm's by the walks among the cells."""
    known: dict[str, OutcomeModel] = {"half-space": half_space_plant(0)}
    for world in WORLDS:
        walks = [one.values["seen"] for one in found.values() if one.cell.settings == {"world": world, "explorer": "walk"}]
        if walks:
            known[world] = truth_of(space_of(world), np.concatenate(walks).astype(np.intp))
    return known
