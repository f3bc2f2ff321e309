# SPDX-License-Identifier: Apache-2.0
"""The reactive control law: a spring pulls the hand to a posture inside the table, and the contact force stops it above the table.

The law is M q" + C q' + L(K (q - q*)) = sum of forces (thesis eq. 5.7), with mass M, damping C and stiffness K. The function L bounds the
force of the spring. The posture q* is called the attractor. The motors here follow the law exactly; the motors of example 05 have lag,
delay, backlash and noise.
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
    """Move the robot from home for SECONDS under the control law, with the posture `target` as attractor; print the progress every second.

    `contact_forces`: whether the controller computes forces that repel the hand from the table. Returns the largest depth to which a solid
    of the robot goes into the table [m].
    """
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
