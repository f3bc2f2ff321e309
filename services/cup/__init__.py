# SPDX-License-Identifier: Apache-2.0
"""Fetches the cup: moves the hand beside it along a roadmap, closes the hand, lifts the cup, puts it down elsewhere, and checks by vision.

Reads: tick, torso and right_arm: {part}/state and {part}/motion, world/{target} of vision.
Calls: {part}/rpc/{take,goal,release} of the controller, model/rpc/world/{list,role}.
"""
