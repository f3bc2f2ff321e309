# SPDX-License-Identifier: Apache-2.0
"""Torso assist as a process: moves the torso so that an arm can reach an object or a marker well.

A posture of the torso is good if the manipulability of the arm at the target, or the reward that a reach learner of the arm predicts for
it, is high.

Reads: tick, {part}/motion, world/{target}.
Writes: {part}/follow.
Calls: {part}/rpc/{take,release} of the controller.
"""
