# SPDX-License-Identifier: Apache-2.0
"""MoBeE 1.0: a process between a client and robot_sim that moves the robot back if a motion leads into contact (thesis chapter 4).

It has two sessions. As a client of the robot it reads: clock, {part}/state, estop; writes: {part}/cmd, event/port_filter; calls:
{part}/rpc/drive/{take,arm,release,hold}, {part}/meta, estop/rpc/reset. In its clients' namespace it acts as the robot: it writes clock,
{part}/state, estop, event/robot_sim; reads {part}/cmd, estop; answers {part}/rpc/drive/{take,arm,release,hold}, {part}/meta,
estop/rpc/reset, and also {part}/rpc/waypoint.
"""
