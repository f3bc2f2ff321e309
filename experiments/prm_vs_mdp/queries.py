"""Rivals on the plant, one query after the other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from experiments.kit.arm_learning import JOINTS, PART
from experiments.prm_vs_mdp.rivals import Rival
from experiments.prm_vs_mdp.scene import Scene, plant_of, space
from mobee.robot.robot import Array, Ints

LIMIT = 120.0  # s of plant time, for a query


@dataclass(frozen=True, slots=True, eq=False)
class Answers:
    """What came of Q queries."""

    success: NDArray[np.bool_]  # (Q,)
    seconds: Array  # (Q,) of plant time, LIMIT where there was no success
    actions: Ints  # (Q,)
    repairs: Ints  # (Q,)


def answer(scene: Scene, rival: Rival, seed: int) -> Answers:
    """Send the rival to every goal, in order; the same noise for all rivals."""
    lattice = space()
    rows = []
    for number, goal in enumerate(scene.goals):
        plant = plant_of(scene, 1000 * seed + number, scene.starts[number])
        begun, before, actions = plant.time, rival.repairs, 0
        rival.begin(int(goal))
        here = plant.measure(PART)[:JOINTS]
        while lattice.state_of(here) != goal and plant.time - begun < LIMIT:
            aim = rival.aim(here)
            if aim is None:
                break
            target = lattice.target(int(goal))
            target[:JOINTS] = aim
            end = plant.act(PART, target).q[:JOINTS]
            rival.observe(here, end)
            here, actions = end, actions + 1
        success, seconds = lattice.state_of(here) == goal, plant.time - begun
        success = success and seconds <= LIMIT
        rows.append((success, seconds if success else LIMIT, actions, rival.repairs - before))
    success, seconds, actions, repairs = zip(*rows, strict=True)
    return Answers(np.array(success), np.array(seconds), np.array(actions), np.array(repairs))
