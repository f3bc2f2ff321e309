"""The offline plant's loop: encoders, model, law and motors, tick after tick, without Python in between.  Compiled; see `tick`."""

from __future__ import annotations

import numpy as np

from mobee.control.marker import PackedReach
from mobee.engine.compiled import entry_exact
from mobee.engine.memory import memory_of
from mobee.engine.neighbours import Around
from mobee.engine.pack import Flags, UInts
from mobee.robot.robot import Array, Ints
from mobee.simulation.tick import Body, Law, feel_pose, judge, measure, move, respond, tell, write

LIMIT, ENDED, LOST = range(3)  # why a run is over: so many ticks, an action has ended, the motors' state is not finite


@entry_exact(
    "UniTuple(int64, 2)("
    # the robot in its scene, see `follow`
    "uint64[::1], float64[::1], float64[::1], float64[::1], uint64[::1], float64[::1], float64[::1], int64[::1], int64, int64, "
    "float64, boolean, uint64[::1], float64[::1], float64[::1], uint64[::1], int64[::1], boolean[::1], boolean, "
    # Law
    "int64[::1], float64[::1], float64[::1], float64[:,::1], float64[::1], float64[::1], float64[:,::1], "
    # the reaches under way
    "int64[:,::1], int64[:,::1], int64[:,:,::1], float64[:,::1], float64[:,:,::1], float64[:,:,::1], "
    # Body
    "int64[::1], int64[:,::1], float64[:,::1], float64[:,::1], float64[:,::1], int64[::1], float64[:,::1], int64, int64, uint64, "
    "float64[::1], boolean, "
    # the rest
    "int64[:,::1], float64[:,::1], float64[::1], float64[::1], float64[:,::1], int64, float64, int64)"
)
def run(
    integers: UInts,
    floats: Array,
    wide: Array,
    vertices: Array,
    world: UInts,
    places: Array,
    wide_places: Array,
    carried: Ints,
    own_shapes: int,
    reaching: int,
    skin: float,
    cut: bool,
    common: UInts,
    slots: Array,
    reals_memory: Array,
    pairs_memory: UInts,
    ints: Ints,
    flags: Flags,
    felt: bool,
    law_integers: Ints,
    law_floats: Array,
    settle: Array,
    law_state: Array,
    attractor: Array,
    client: Array,
    forces: Array,
    reach_whole: Ints,
    reach_pulled: Ints,
    reach_driven: Ints,
    reach_real: Array,
    reach_chain: Array,
    reach_motors: Array,
    living: Ints,
    whole: Ints,
    fixed: Array,
    state: Array,
    line: Array,
    at: Ints,
    commands: Array,
    mode: int,
    substeps: int,
    seed: int,
    noise: Array,
    noisy: bool,
    parts: Ints,
    tests: Array,
    q: Array,
    torque: Array,
    record: Array,
    ticks: int,
    dt: float,
    most: int,
) -> tuple[int, int]:
    """Run at most that many ticks of dt [s] after the `ticks` there have been; returns how many were run, and why no more.

    `cut`: see `project`; `felt`: contacts are looked for.  `parts` (P, PART), `tests` (P, 2): actions
    and their settle tests; `q`, `torque` (n,): encoders and projected depths of the last tick.  `record` (`most`, 3 n + 2), see
    `write`, or without rows.
    """
    here = Around(integers, floats, wide, vertices, world, places, wide_places, carried, own_shapes, reaching, skin, cut, common, slots)
    memory = memory_of(integers, world, reals_memory, pairs_memory, ints, flags)
    law = Law(law_integers, law_floats, settle, law_state, attractor, client, forces, np.empty(len(q)))
    reaches = PackedReach(reach_whole, reach_pulled, reach_driven, reach_real, reach_chain, reach_motors)
    body = Body(living, whole, fixed, state, line, at, commands, mode, substeps, np.uint64(seed), noise, noisy)
    count = np.uint64(0)
    for done in range(most):
        k = ticks + done + 1
        tell(body, k)
        if not measure(body, k, q):
            return done, LOST
        if felt:
            count = feel_pose(here, memory, q, torque)
        respond(law, reaches, body, k, dt, q, torque)
        move(body, dt)
        if len(record) > 0:
            write(body, law, memory, count, q, record[done])
        if judge(law, reaches, parts, tests, k * dt - dt):
            return done + 1, ENDED
    return most, LIMIT
