# SPDX-License-Identifier: Apache-2.0
"""Fetches the cup: reaches beside it along a map, closes the hand, lifts it, puts it down elsewhere, and looks whether it is there.

Reads: tick, torso and right_arm: {part}/state and {part}/motion, world/{target} of vision.
Calls: {part}/rpc/{take,goal,release} of the controller, model/rpc/world/{list,role}.
"""
