# SPDX-License-Identifier: Apache-2.0
"""The agent of one part as a process: explores by curiosity, or learns to reach if it has targets.

Reads: clock, {part}/motion, {part}/reach.
Writes: agents/{part}/{transition,learned}.
Answers: agent_{part}/rpc/{rest,resume,explore}.
Calls: {part}/rpc/{take,goal,reach} of the controller, model/rpc/world/{add,remove,list}; sim/rpc/place, if `put_back` is set.
"""
