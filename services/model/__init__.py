"""The egocentric model as a process: whole-body state in, constraint forces out.

Reads: clock, {part}/state, world/*.
Writes: model/forces, model/pose, model/contacts.
Answers: model/rpc/world/{add,move,remove,role,attach,detach,list}, model/rpc/jacobian.
"""
