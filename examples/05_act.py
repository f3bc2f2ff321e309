# SPDX-License-Identifier: Apache-2.0
"""One action on a plant: go there, and say where you got.

An agent acts through `plant.act(part, target) -> Outcome` and does not know what answers: the OfflinePlant here (motors,
model and controller in this process), or BusPlant, its live twin, in example 08's system.
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
    """Act once and print the outcome."""
    outcome = plant.act("left_arm", target)
    error = np.rad2deg(abs(outcome.q[pitch] - target[pitch]))
    end = "settled" if outcome.settled else "timed out"
    touching = ", ".join(outcome.touched) or "nothing"
    print(f"{what}: {end} after {outcome.duration:.1f} s, shoulder {error:.1f} deg from its target, touching {touching}")


target = robot.home[arm.slice].copy()
target[pitch] = np.deg2rad(-50)
show("up", target)

# A target inside the table is a fair thing to ask for: the forces stop the arm, and that outcome is an observation too.
into = robot.home[arm.slice].copy()
into[pitch] = np.deg2rad(-5)
show("into the table", into)
show("up again", target)

print(f"plant time {plant.time:.1f} s; the same seed gives the same noise, and so the same outcomes")
