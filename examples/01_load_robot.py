# SPDX-License-Identifier: Apache-2.0
"""Load a robot and print its parts, motors, limits, markers and shapes."""

from __future__ import annotations

import numpy as np

import mobee

robot = mobee.load_robot("icub")  # a shipped name (`mobee robots` lists them), or the path of your own file
print(f"{robot.name}: {len(robot.motors)} motors, {len(robot.joints)} joints, {len(robot.links)} links")

# q, everywhere in MoBeE, is the vector of all motor positions in rad, in the order of robot.motors.
# Each part has a slice of it.
for part in robot.parts.values():
    print(f"  {part.name:<9} {len(part):2d} motors, q[{part.slice.start}:{part.slice.stop}]")

print("\nthe left arm, in degrees for the reader:")
arm = robot.parts["left_arm"]
for name, (low, high), home in zip(arm.motors, np.rad2deg(robot.limits[arm.slice]), np.rad2deg(robot.home[arm.slice]), strict=True):
    print(f"  {name:<18} {low:6.1f} .. {high:6.1f}   home {home:5.1f}")

solids = [shape for shape in robot.shapes if shape.role == "solid"]
fields = [shape for shape in robot.shapes if shape.role == "field"]
print(f"\nmarkers: {', '.join(robot.markers)}")
print(f"shapes: {len(solids)} solids (the body) and {len(fields)} fields (larger volumes that only generate force)")
print(f"linear constraints (shoulder cables, forearms): {len(robot.clauses)}")

# The error for a wrong name gives the nearest valid name.
try:
    robot.motor_index("l_elbw")
except mobee.UnknownName as error:
    print(f"\na typo: {str(error)[:50]}...")
