# SPDX-License-Identifier: Apache-2.0
"""The monitor: a page on the loopback interface that shows and controls the robot, and a recording.

Reads: clock, {part}/state, {part}/motion, {part}/reach, model/forces, controller/forces, model/contacts, world/*,
vision/image/{camera}, agents/*/{decision,transition,learned}, event/*, estop, alive/*/*; asks model/rpc/world/list.
Writes: event/monitor.  On request of a user of the page: estop, also into its record on disk, and calls of robot_sim, controller, model
and agents (controls.py).
"""
