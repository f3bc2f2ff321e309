# SPDX-License-Identifier: Apache-2.0
"""The egocentric model (the robot's model of its body and the objects around it) as a process: publishes constraint forces.

It computes them from the state of the whole body. Keys of its messages and calls on the bus:
Reads: tick, world/*, {part}/reach.
Writes: model/forces, model/targets, model/pose, model/contacts.
Answers: model/rpc/world/{add,move,remove,role,attach,detach,list}, model/rpc/jacobian.
"""
