"""The iCub presses its hands into the table: postures 5 to 25 cm below its top are what it is sent to."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from experiments.control.depths import deepest, oscillation
from experiments.control.models import icub, icub_at_table
from experiments.control.postures import random_posture
from experiments.control.ride import ride
from mobee import Gains
from mobee.robot.robot import Array
from mobee.simulation import MotorParameters, OfflinePlant

SEED = 7
SECONDS, REST = 6.0, 2.0  # s, a press; its end, in which chatter is measured
LATTICE_MOTORS = {"torso": 3, "left_arm": 4, "right_arm": 4}
WITHIN = (0.1, 0.9)  # of their ranges
BELOW_TOP = (-0.25, -0.05)  # m
ABOVE_BLOCK = (-0.6, -0.2)  # m, along x
TOP = -0.1  # m
PALMS = ("left_palm", "right_palm")


@dataclass(frozen=True, slots=True)
class Pressed:
    """What one press came to [m]."""

    solid: float
    field: float
    chatter: float  # of the palms


def targets(count: int) -> list[Array]:
    """Postures without a table in which a palm is below the top of the table to come."""
    robot = icub_at_table().robot
    rng, free = np.random.default_rng(SEED), icub()
    found: list[Array] = []
    while len(found) < count:
        q = random_posture(robot, rng, LATTICE_MOTORS, WITHIN)
        pose = free.evaluate(q)
        palms = [pose.position(marker) for marker in PALMS]
        low_enough = any(BELOW_TOP[0] < z - TOP < BELOW_TOP[1] and ABOVE_BLOCK[0] < x < ABOVE_BLOCK[1] for x, _, z in palms)
        if low_enough and not pose.count:
            found.append(q)
    return found


def press(gains: Gains, target: Array, age: int, dt: float = 0.01) -> Pressed:
    """Send all parts to the target at once, with commands that are `age` ticks old, and watch."""
    late = MotorParameters(delay=float(MotorParameters().of_motors("delay", 1)[0]) + (age - 1) * dt)
    plant = OfflinePlant(icub_at_table(), SEED, gains, late, dt)
    plant.controller.attractor = target
    done = ride(plant, SECONDS)
    depths, rest = deepest(icub_at_table(), done.q[::2]), done.last(REST)
    return Pressed(depths.solid, depths.field, max(oscillation(icub_at_table(), rest, palm) for palm in PALMS))
