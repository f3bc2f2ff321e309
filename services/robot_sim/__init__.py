# SPDX-License-Identifier: Apache-2.0
"""The simulated robot: motors, safety gate, state streams and, in a second process, the pictures of its cameras.

Writes: `tick`, `clock`, `{part}/state`, `sim/truth`, `estop` (while it is latched), `event/robot_sim`; in lockstep `turn/{participant}`.
Reads: `commands`, `{part}/cmd`, `estop`, `alive/*/*`; in lockstep `done/{service}`; and the record of emergency stops on disk.
Answers: `{part}/rpc/drive/{take,arm,release,hold}`, `{part}/meta`, `sim/rpc/{place,reset,pause,resume,pace}`,
`estop/rpc/reset`, `robot_sim/rpc/{stat,pulse,mark,config,shutdown}`.
"""
