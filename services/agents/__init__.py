# SPDX-License-Identifier: Apache-2.0
"""The agent of one part as a process: explores by curiosity, or learns to reach if it has targets.

Reads: clock (in lockstep turn/agent_{part}), {part}/motion, {part}/reach.
Writes: agents/{part}/{transition,decision,learned}.
Answers: agent_{part}/rpc/{rest,resume,explore}.
Calls: {part}/rpc/{take,release,goal,reach} of the controller, model/rpc/world/{add,remove,list}; sim/rpc/place, if `put_back` is set.
"""
