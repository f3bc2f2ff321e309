# SPDX-License-Identifier: Apache-2.0
"""The client of `babbling`: random position moves of 23 motors, as a process on the bus.

At the drives of the robot, or of the filter in front of it, reads: clock, {part}/state; writes: {part}/cmd;
calls: {part}/rpc/drive/{take,arm}.  At the controller's goals, reads: clock, {part}/motion; calls: {part}/rpc/{take,goal}.
"""
