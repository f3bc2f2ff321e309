# SPDX-License-Identifier: Apache-2.0
"""The monitor: a page on loopback that shows what the robot does and has controls for it; and a recording.

Reads: clock, {part}/state, {part}/motion, {part}/reach, model/forces, controller/forces, model/contacts, world/*,
vision/image/{camera}, agents/*/{decision,transition,learned}, event/*, estop, alive/*/*; asks model/rpc/world/list.
Writes: event/monitor.  When a person asks for it on the page: estop, and calls of robot_sim, controller, model and agents (controls.py).
"""
