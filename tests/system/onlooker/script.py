# SPDX-License-Identifier: Apache-2.0
"""The script: an agent whose state holds where a cup is acts, and the cup is put elsewhere meanwhile."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from mobee import CuriousAgent, Grid, Lattice, ObjectSpace, PerceivingPlant, Plant
from mobee.arrays import Array

PART = "left_arm"
PLACES = ((-0.45, -0.15, -0.055), (-0.45, 0.15, -0.055))  # m, of the cup at first and after half of the actions
ACTIONS = 6


def perform(plant: Plant, places: Callable[[], Mapping[str, Array]], move: Callable[[tuple[float, ...]], object]) -> list[list[int]]:
    """Return state, action, and state reached of each transition, and the cell of the cup in it."""
    postures = Lattice(plant.robot, ["l_shoulder_yaw", "l_elbow"], neighbours="equidistant")
    space = ObjectSpace(postures, Grid((-0.6, -0.3), (-0.3, 0.3), (1, 2)), "cup")
    agent = CuriousAgent(space, PerceivingPlant(plant, places))
    found = []
    for number in range(ACTIONS):
        if number == ACTIONS // 2:
            move(PLACES[1])
        agent.step()
        if agent.last is not None:
            found.append([agent.last.s, agent.last.a, agent.last.s_next, space.cell(agent.last.s_next)])
    return found
