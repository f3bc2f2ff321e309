"""The MoBeE controller as a process: goals and forces in, motor commands out.

Reads: clock, {part}/state, model/forces.
Writes: {part}/cmd, {part}/motion.
Answers: {part}/rpc/{take,release,goal,force}.
Calls: {part}/rpc/drive/{take,arm} of robot_sim.
"""
