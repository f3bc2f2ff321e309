"""Which of the targets inverse kinematics can reach, with the joints of the lattice and with all of the arm's.

`python -m experiments.reaching.reachable` prints the table in this folder's README.
"""

from __future__ import annotations

import sys

from experiments.kit.arm_learning import RIGHT, robot
from experiments.reaching.inverse import nearest_pose
from experiments.reaching.scene import MARKER, PART
from experiments.reaching.targets import GOOD, between, grid
from mobee import Model
from mobee.reach import RADIUS
from mobee.robot.robot import Array

AT_CENTRE = 2e-3  # m: the palm is at the centre


def joints_of(count: int) -> tuple[str, ...]:
    """The first motors of the right arm: 4 are those of the lattice, 7 are all but those of the hand."""
    return robot().parts[PART].motors[:count]


def distances(places: Array, joints: tuple[str, ...]) -> list[float]:
    """How near the palm can come to each place (P, 3) m; the other joints at home, limits and cables respected, contacts not."""
    model = Model(robot())
    return [nearest_pose(model, MARKER, place, joints, good=AT_CENTRE / 10.0).distance for place in places]


def counts(found: list[float]) -> tuple[int, int]:
    """At how many the palm can be at the centre, and within 2 cm of the surface."""
    return sum(d <= AT_CENTRE for d in found), sum(d <= RADIUS + GOOD for d in found)


def table() -> str:
    """The distances of all targets, and how many can be reached."""
    lines = ["| joints | targets | palm at the centre | palm within 2 cm of the surface |", "| --- | --- | --- | --- |"]
    each = {}
    for count in (len(RIGHT), 7):
        for name, places in (("the 27 of the grid", grid()), ("the 8 between", between())):
            found = distances(places, joints_of(count))
            each[count, name] = found
            lines.append(f"| {count} | {name} | {counts(found)[0]} | {counts(found)[1]} |")
    lines += ["", "| target | x | y | z | nearest with 4 joints [cm] | with 7 |", "| --- | --- | --- | --- | --- | --- |"]
    name = "the 27 of the grid"
    for number, (place, four, seven) in enumerate(zip(grid(), each[4, name], each[7, name], strict=True)):
        where = " | ".join(f"{value:.1f}" for value in place)
        lines.append(f"| {number} | {where} | {100.0 * four:.1f} | {100.0 * seven:.1f} |")
    return "\n".join(lines)


if __name__ == "__main__":
    sys.stdout.write(table() + "\n")
