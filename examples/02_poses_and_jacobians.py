# SPDX-License-Identifier: Apache-2.0
"""Compute the pose of the hand and its Jacobian, for one q or for a thousand."""

from __future__ import annotations

import time

import numpy as np

import mobee

np.set_printoptions(precision=3, suppress=True)
robot = mobee.load_robot("icub")
model = mobee.Model(robot)

# One pose. The root frame: x backwards, y right, z up, origin at the waist.
pose = model.evaluate(robot.home)
print(f"left palm at home: {pose.position('left_palm')} m, its normal points to {pose.normal('left_palm')}")

# Its Jacobian: three linear rows, then three angular rows; one column for each motor.
jacobian = model.jacobian(robot.home, "left_palm")
pitch = robot.motor_index("torso_pitch")
print(f"Jacobian: {jacobian.shape}; torso_pitch moves the palm by {jacobian[:3, pitch]} m a rad")

# The same Jacobian by finite differences.
step = 1e-6
moved = robot.home.copy()
moved[pitch] += step
difference = (model.evaluate(moved).position("left_palm") - pose.position("left_palm")) / step
print(f"finite differences say {difference}")

# A batch of poses: q may have any leading shape.
rng = np.random.default_rng(0)
many = rng.uniform(*robot.limits.T, size=(1000, len(robot.motors)))
start = time.perf_counter()
palms = model.evaluate(many).position("left_palm")
jacobians = model.jacobian(many, "left_palm")
print(f"\n{len(many)} random poses: positions {palms.shape}, Jacobians {jacobians.shape}, in {time.perf_counter() - start:.2f} s")
low, high = palms.min(axis=0), palms.max(axis=0)
print(f"the palm was within x {low[0]:.2f} .. {high[0]:.2f}, y {low[1]:.2f} .. {high[1]:.2f}, z {low[2]:.2f} .. {high[2]:.2f} m")
