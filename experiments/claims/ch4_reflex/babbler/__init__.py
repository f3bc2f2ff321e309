# SPDX-License-Identifier: Apache-2.0
"""The client of the experiment `babbling`: random position moves of 23 motors, as a process on the bus.

It commands either the drives of the robot, or the goals of MoBeE's controller.  With MoBeE 1.0, the port filter receives the commands to
the drives, filters them and forwards them to the robot.

For drives: it reads clock and {part}/state, writes {part}/cmd, and calls {part}/rpc/drive/{take,arm}.  For goals: it reads clock and
{part}/motion, and calls {part}/rpc/{take,goal}.
"""
