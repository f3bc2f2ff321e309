"""A curious agent of one part as a process; torso, left arm and right arm are three of them.  With targets it learns to reach.

Reads: clock, {part}/motion, {part}/reach.
Writes: agents/{part}/{transition,learned}.
Calls: {part}/rpc/{take,goal,reach} of the controller, model/rpc/world/{add,remove}.
"""
