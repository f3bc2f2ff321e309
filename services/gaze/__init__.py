# SPDX-License-Identifier: Apache-2.0
"""Gaze as a process: keeps an object that vision finds, or a marker of the robot, in the middle of the pictures.

Reads: tick, {part}/motion, world/{target}.
Writes: {part}/follow.
Calls: {part}/rpc/{take,release} of the controller.
"""
