"""The client of `babbling`: random position moves of 23 motors, as a process on the bus.

At the robot's drives (or at those that a filter in front of it offers), reads: clock, {part}/state; writes: {part}/cmd;
calls: {part}/rpc/drive/{take,arm}.  At the controller's goals, reads: clock, {part}/motion; calls: {part}/rpc/{take,goal}.
"""
