# SPDX-License-Identifier: Apache-2.0
"""Move a hand to a point by two methods: plan a path in advance, then let a force pull the hand (thesis Algorithm 5).

The function `reach_path` uses only the kinematics of the robot. A `Reacher` instead pulls the marker (a named point on the hand) by a force
through the controller, tick by tick, and the whole body may move. The limits, constraints and contacts of example 04 still act. If the
point is out of reach, the marker rests where no small motion brings it nearer.
"""

from __future__ import annotations

import numpy as np

import mobee

PATIENCE = 20.0  # s

robot = mobee.load_robot("icub")
model = mobee.Model(robot, mobee.load_world("table"))
home = model.evaluate(robot.home).position("left_palm")
targets = {
    "in front": home + [-0.05, 0.0, 0.10],
    "out of reach": home + [-0.50, 0.0, 0.10],
    "under the table's top": home + [-0.02, 0.0, -0.15],
}

path = mobee.reach_path(model, "left_palm", targets["in front"], robot.home)
print(f"in advance: {path.end} after {len(path.q) - 1} steps, {1000 * path.distance:.1f} mm from the target\n")

plant = mobee.OfflinePlant(model, seed=0)

for name, target in targets.items():
    reacher = mobee.Reacher(plant.controller, "left_palm", target)
    begin, status = plant.time, "reaching"
    while status == "reaching" and plant.time < begin + PATIENCE:
        status = reacher.update(plant.q, plant.dt)
        plant.tick()
    reacher.stop(plant.q)
    pose = model.evaluate(plant.motors.q)
    solids = sum(contact.kind == "solid" for contact in pose.contacts)
    away = 100 * np.linalg.norm(pose.position("left_palm") - target)
    print(f"{name}: {status} after {plant.time - begin:.1f} s, palm {away:.1f} cm from the target, {solids} solids touch")
