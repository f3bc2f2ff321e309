# SPDX-License-Identifier: Apache-2.0
"""The agent of one part as a process: explores by curiosity, or learns to reach if it has targets.

Reads: clock (in lockstep turn/agent_{part}), {part}/motion, {part}/reach.
Writes: agents/{part}/{transition,decision,learned}.
Answers: agent_{part}/rpc/{rest,resume,explore}.
Calls: {part}/rpc/{take,release,goal,reach} of the controller, model/rpc/world/{add,remove,list}; also sim/rpc/place, if
the setting `put_back` is given (position to which the simulator moves the object when it is not seen).
"""
