# SPDX-License-Identifier: Apache-2.0
"""The egocentric model as a process: reads the state of the whole body, publishes constraint forces.

Reads: tick, world/*, {part}/reach.
Writes: model/forces, model/targets, model/pose, model/contacts.
Answers: model/rpc/world/{add,move,remove,role,attach,detach,list}, model/rpc/jacobian.
"""
