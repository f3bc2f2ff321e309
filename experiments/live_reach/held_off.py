"""Why a target was missed: how near reaches from all states come to it on the offline plant, and what is felt at the nearest end.

`python -m experiments.live_reach.held_off` prints it for those of the 27 that can be reached, in some minutes.
"""

from __future__ import annotations

import sys

import numpy as np

from experiments.kit.control_runs import place
from experiments.live_reach.problems import grid_targets, touchable
from experiments.live_reach.settings import GOOD, MARKER, PART, belief, offline_plant, space
from mobee.reach import ReachTarget
from mobee.simulation import OfflinePlant

TELL = 2  # of what is felt, the deepest


def nearest_reach(plant: OfflinePlant, target: ReachTarget) -> tuple[float, str]:
    """The least that a reach from a state misses, m, and what the arm feels there: pairs with their depths in mm.

    It stops at the first that succeeds.
    """
    best, ending = np.inf, plant.robot.home
    arm = plant.robot.part(PART).slice
    for state in range(len(space())):
        whole = plant.robot.home.copy()
        whole[arm] = space().target(state)
        plant.present(None)
        place(plant, whole)
        plant.present(target)
        made = plant.reach(PART, MARKER, stay=True)
        if made.missing < best:
            best, ending = made.missing, whole.copy()
            ending[arm] = made.q
        if best <= GOOD:
            break
    return best, _felt(plant, ending)


def _felt(plant: OfflinePlant, q: np.ndarray) -> str:
    """The deepest contacts of a pose (n,) rad while the hand reaches."""
    plant.model.reaching = MARKER
    contacts = sorted(plant.model.evaluate(q).contacts, key=lambda contact: -contact.depth)
    plant.model.reaching = None
    return ", ".join(f"{one.first} {one.second} {1e3 * one.depth:.0f}" for one in contacts[:TELL])


def main() -> None:
    """Print the table."""
    known, plant = belief(), offline_plant(0)
    lines = ["| target | x | y | z | nearest reach [mm] | felt there [mm] |", "| --- | --- | --- | --- | --- | --- |"]
    for number, target in enumerate(grid_targets()):
        if touchable(known, target):
            off, felt = nearest_reach(plant, target)
            where = " | ".join(f"{x:.1f}" for x in target.position)
            lines.append(f"| {number} | {where} | {1e3 * off:.0f} | {felt if off > GOOD else ''} |")
    sys.stdout.write("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
