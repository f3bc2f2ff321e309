# SPDX-License-Identifier: Apache-2.0
"""The reactive layer: an attractor inside the table pulls, the contact's force stops the hand above it.

The controller is a dynamical system, M q" + C q' + L(K (q - q*)) = sum of forces (thesis eq. 5.7). The motors here follow it
exactly; the motors of example 05 have lag, delay, backlash and noise.
"""

from __future__ import annotations

import numpy as np

import mobee

DT, SECONDS = 0.01, 4.0
TOP = -0.10  # m, of the table

robot = mobee.load_robot("icub")
model = mobee.Model(robot, mobee.load_world("table"))

target = robot.home.copy()
target[robot.motor_index("l_shoulder_pitch")] = np.deg2rad(-15)
target[robot.motor_index("l_elbow")] = np.deg2rad(25)


def depth_in_table(pose: mobee.Pose) -> float:
    """Return the depth of the deepest contact between a solid of the robot and the table, in m."""
    return max((contact.depth for contact in pose.contacts if contact.kind == "solid" and contact.second == "table"), default=0.0)


wanted = model.evaluate(target)
below = TOP - wanted.position("left_palm")[2]
print(f"the attractor: left palm {100 * below:.1f} cm below the table's top, fingers {100 * depth_in_table(wanted):.1f} cm deep in it")


def press(contact_forces: bool) -> float:
    """Run the controller towards the attractor; return the largest depth of the solid hand in the table, in m."""
    controller = mobee.Controller(model, gains=mobee.Gains.default(), contact_forces=contact_forces)
    controller.reset(robot.home)
    controller.attractor = target
    q, deepest = robot.home.copy(), 0.0
    for tick in range(round(SECONDS / DT)):
        pose = model.evaluate(q)
        forces = controller.forces(pose)
        command = controller.step(q, DT, forces)
        q = q + command.velocity * DT
        deepest = max(deepest, depth_in_table(pose))
        if tick % 100 == 99:
            height, force = pose.position("left_palm")[2] - TOP, np.abs(forces.collision).max()
            print(f"    {(tick + 1) * DT:.0f} s: palm {100 * height:5.1f} cm above the top, largest contact force {force:5.1f} rad/s^2")
    return deepest


print("\nwith contact forces:")
guarded = press(contact_forces=True)
print("without:")
unguarded = press(contact_forces=False)
print(f"\nthe solid hand went {1000 * guarded:.0f} mm into the table with the forces, {1000 * unguarded:.0f} mm without")
