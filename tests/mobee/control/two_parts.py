# SPDX-License-Identifier: Apache-2.0
"""The planar arm of the other tests with its first joint as a part of its own, and an object to touch."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mobee.model import World, sphere
from mobee.model.model import Model
from mobee.robot.robot import Part, Robot
from tests.mobee.planar import planar_arm


def two_part_arm() -> Robot:
    """Parts "trunk" (m0) and "arm" (m1, m2)."""
    one = planar_arm()
    motors = (replace(one.motor_table[0], part="trunk"), *one.motor_table[1:])
    return replace(one, motor_table=motors, parts={"trunk": Part("trunk", ("m0",), 0), "arm": Part("arm", ("m1", "m2"), 1)})


def touching(gap: float = -0.02) -> Model:
    """The stretched arm with a ball of 5 cm on its right (-y), `gap` m from the surface of the tip's field of 12 cm."""
    world = World()
    world.add("ball", sphere(0.05), position=(0.9, -0.17 - gap, 0.0))
    return Model(two_part_arm(), world)


STRETCHED = np.zeros(3)
