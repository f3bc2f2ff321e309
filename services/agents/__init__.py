"""A curious agent of one part as a process; torso, left arm and right arm are three of them.

Reads: clock, {part}/motion.
Writes: agents/{part}/{transition,learned}.
Calls: {part}/rpc/{take,goal} of the controller.
"""
