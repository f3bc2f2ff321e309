"""Press the iCub into the table: how deep do the fields and the solids get, and does the motion die down?

Claim: with `Gains.default()` no solid touches the table although the attractors put the hands 5 to 25 cm below its top, every
part settles, and both still hold when the commands are three ticks old.  Source: this project's tuning (DESIGN
section 6).  Run time: about 40 s.  `python -m experiments.control.press`
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np

from mobee.control import Command, Controller, Forces, Gains
from mobee.model import Model
from mobee.robot.load import load_robot, load_world
from mobee.robot.robot import Array, Robot
from mobee.simulation import OfflinePlant

POSES, SECONDS, SEED = 10, 7.0, 7
LATTICE_MOTORS = {"torso": 3, "left_arm": 4, "right_arm": 4}
BELOW_TOP = (-0.25, -0.05)  # m
ABOVE_BLOCK = (-0.6, -0.2)  # m, along x


@dataclass
class Press:
    """What one press came to."""

    solid: float  # m, deepest
    field: float  # m, deepest
    settled: bool
    restless: float  # rad/s, standard deviation of the least quiet motor in the last 1.5 s


def targets(robot: Robot) -> list[Array]:
    """Postures without a table in which a palm is below the top of the table to come."""
    rng, model = np.random.default_rng(SEED), Model(robot)
    found: list[Array] = []
    while len(found) < POSES:
        q = robot.home.copy()
        for part, count in LATTICE_MOTORS.items():
            where = slice(robot.parts[part].start, robot.parts[part].start + count)
            low, high = robot.limits[where].T
            q[where] = low + rng.uniform(0.1, 0.9, count) * (high - low)
        pose = model.evaluate(q)
        palms = [pose.position(marker) for marker in ("left_palm", "right_palm")]
        low_enough = any(BELOW_TOP[0] < z + 0.1 < BELOW_TOP[1] and ABOVE_BLOCK[0] < x < ABOVE_BLOCK[1] for x, _, z in palms)
        if low_enough and not pose.count:
            found.append(q)
    return found


class LateController(Controller):
    """The controller, its commands delayed by some ticks more."""

    late: deque[Command]

    def step(self, q: Array, dt: float, forces: Forces | None = None) -> Command:
        """The command of some ticks ago."""
        self.late.append(super().step(q, dt, forces))
        return self.late.popleft()


def press(robot: Robot, gains: Gains, target: Array, extra_ticks: int) -> Press:
    """Send all parts to the target at once and watch."""
    model = Model(robot, load_world("table"))
    plant = OfflinePlant(model, SEED, gains)
    controller = LateController(model, gains)
    rest = np.zeros(len(robot.motors))
    controller.late = deque([Command(robot.home, rest, rest)] * extra_ticks)
    plant.controller = controller
    for part in LATTICE_MOTORS:
        plant.begin(part, target[robot.parts[part].slice])
    deepest, velocities = {"solid": 0.0, "field": 0.0}, []
    for _ in range(round(SECONDS / plant.dt)):
        plant.tick()
        velocities.append(plant.controller.velocity)
        for contact in plant.pose.contacts if plant.pose else ():
            if contact.second == "table":
                deepest[contact.kind] = max(deepest[contact.kind], contact.depth)
    last = np.array(velocities[-150:])
    quiet = bool(np.all(np.abs(last[-1]) <= gains.settle.speed))
    return Press(deepest["solid"], deepest["field"], quiet, float(last.std(axis=0).max()))


def main() -> None:
    """Print a line a gain set and command age."""
    robot = load_robot("icub")
    poses = targets(robot)
    for name in ("default", "published_2014"):
        for age in (1, 3):
            results = [press(robot, Gains.named(name), pose, age - 1) for pose in poses]
            print(
                f"{name}, command age {age}: deepest solid {1e3 * max(r.solid for r in results):.0f} mm,"
                f" field {1e3 * max(r.field for r in results):.0f} mm, slow at the end {sum(r.settled for r in results)} of {POSES},"
                f" restless at most {np.rad2deg(max(r.restless for r in results)):.1f} deg/s"
            )


if __name__ == "__main__":
    main()
