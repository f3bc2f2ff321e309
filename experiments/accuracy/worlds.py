"""The worlds in which models are learnt, and what is true of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache

import numpy as np

from experiments.learning.published import ARM_NEIGHBOURS, arm_plant, arm_space
from experiments.learning.truth import truth_of
from experiments.sweep import CellResult
from mobee import Lattice, Plant
from mobee.learning.tabular import TabularPlant, half_space
from mobee.learning.value_iteration import OutcomeModel

WORLDS = {
    "half-space": "half-space, equidistant neighbours",
    "equidistant": "the arm, equidistant neighbours",
    "nearest": "the arm, 16 nearest neighbours",
}
WALK_TRIES = {"equidistant": 40, "nearest": 20}  # of each walk
WALKS = (9001, 9002)  # seeds that no explorer has


@cache
def space_of(world: str) -> Lattice:
    """The 81 states of an arm."""
    return arm_space(neighbours=ARM_NEIGHBOURS if world == "nearest" else "equidistant")


def plant_of(world: str) -> Callable[[int], Plant]:
    """What makes the world's plant of a seed."""
    return half_space_plant if world == "half-space" else arm_plant


def half_space_plant(seed: int) -> TabularPlant:
    """The half-space in which states 24, 51 and 78 are cut off."""
    space = space_of("half-space")
    return TabularPlant(space, *half_space(space), seed)


def truths(found: Mapping[str, CellResult]) -> dict[str, OutcomeModel]:
    """The truth of each world that has one: the half-space's own table, the arm's by the walks among the cells."""
    known: dict[str, OutcomeModel] = {"half-space": half_space_plant(0)}
    for world in WALK_TRIES:
        walks = [
            one.values["seen"]
            for one in found.values()
            if one.cell.settings == {"world": world, "explorer": "walk", "tries": WALK_TRIES[world]}
        ]
        if walks:
            known[world] = truth_of(space_of(world), np.concatenate(walks).astype(np.intp))
    return known
