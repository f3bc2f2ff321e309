# SPDX-License-Identifier: Apache-2.0
"""The monitor: serves a page on the loopback interface that shows and controls the robot, and records the 3D view and the page's values.

Reads: clock, {part}/state, {part}/motion, {part}/reach, model/forces, controller/forces, model/contacts, world/*,
vision/image/{camera}, agents/*/{decision,transition,learned}, event/*, estop, alive/*/*; asks model/rpc/world/list.
Writes: event/monitor. If a user of the page requests an emergency stop, the monitor publishes it (estop), and records it in a file on
disk. For other requests of users, the monitor calls robot_sim, controller, model and agents (controls.py).
"""
