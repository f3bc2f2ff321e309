# SPDX-License-Identifier: Apache-2.0
"""The MoBeE controller as a process: reads goals and forces, publishes motor commands.

Reads: tick, model/forces, model/targets, {part}/follow, estop.
Writes: commands, {part}/motion, {part}/reach, controller/forces.
Answers: {part}/rpc/{take,release,goal,force,reach}.
Calls: {part}/rpc/drive/{take,arm} of robot_sim.
"""
