"""The process that reaches on the live robot: the learner, which may go on learning, or the planner, a block of tries at a time.

Reads: {part}/motion, {part}/reach, commands.
Calls: {part}/rpc/{take,goal,reach} of the controller, model/rpc/world/{add,remove}, launcher/rpc/shutdown.
"""
