# SPDX-License-Identifier: Apache-2.0
"""Torso assist as a process: moves the torso so that an object that vision finds, or a marker, is where an arm reaches well.

Reads: tick, {part}/motion, world/{target}.
Writes: {part}/follow.
Calls: {part}/rpc/{take,release} of the controller.
"""
