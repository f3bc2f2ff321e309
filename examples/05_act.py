# SPDX-License-Identifier: Apache-2.0
"""Perform one action on a plant: move to a target, and print the outcome.

An agent acts through `plant.act(part, target) -> Outcome`, and need not know which plant it has: the OfflinePlant here (motors,
model and controller in this process), or BusPlant, which has the same methods and acts on the live system of example 08.
"""

from __future__ import annotations

import numpy as np

import mobee

robot = mobee.load_robot("icub")
world = mobee.load_world("table")
plant = mobee.OfflinePlant(mobee.Model(robot, world), seed=0)

arm = robot.parts["left_arm"]
pitch = arm.motors.index("l_shoulder_pitch")


def show(what: str, target: np.ndarray) -> None:
    """Move the left arm to `target` (n_part,) rad, and print the outcome after the title `what`."""
    outcome = plant.act("left_arm", target)
    error = np.rad2deg(abs(outcome.q[pitch] - target[pitch]))
    end = "settled" if outcome.settled else "timed out"
    touching = ", ".join(outcome.touched) or "nothing"
    print(f"{what}: {end} after {outcome.duration:.1f} s, shoulder {error:.1f} deg from its target, touching {touching}")


target = robot.home[arm.slice].copy()
target[pitch] = np.deg2rad(-50)
show("up", target)

# A target inside the table is valid: the forces stop the arm, and the agent learns from this outcome too.
into = robot.home[arm.slice].copy()
into[pitch] = np.deg2rad(-5)
show("into the table", into)
show("up again", target)

print(f"plant time {plant.time:.1f} s; the same seed gives the same noise, and so the same outcomes")
