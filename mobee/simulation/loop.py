"""The offline plant's loop: encoders, model, law and motors, tick after tick, without Python in between.  Compiled.

See `layout` for the arrays of the motors and parts, `mobee.control.layout` for those of the law.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from mobee.control.law import advance, constraint_forces, settle_look
from mobee.control.layout import MOVING, OWN_VELOCITY, SETTLED
from mobee.control.layout import REFERENCE as OWN_REFERENCE
from mobee.control.reach_law import Reaches, add_all, goes_on
from mobee.engine.compiled import entry_exact, inner_exact
from mobee.engine.feel import feel
from mobee.engine.memory import Memory, memory_of
from mobee.engine.neighbours import Around, find
from mobee.engine.pack import Flags, UInts
from mobee.engine.rows import NUMBERS, REALS
from mobee.robot.robot import Array, Ints
from mobee.simulation.drive import drive, enter, integrate
from mobee.simulation.layout import ACTING, FIRST, POSITION, REFERENCE, STOP, TORQUE, VERDICT, Q
from mobee.simulation.noise import add_noise

LIMIT, ENDED, LOST = range(3)  # why a run is over: so many ticks, an action has ended, the motors' state is not finite


class Law(NamedTuple):
    """The law and its state: `forces` (3, n) f_lim, f_cst and f_coll; `client` (n,) f_config and f_work, all in rad/s^2."""

    integers: Ints
    floats: Array
    settle: Array
    state: Array
    attractor: Array
    client: Array
    forces: Array
    total: Array


class Body(NamedTuple):
    """The motors: `commands` (age, n) are those on their way, `noise` [rad] and `seed` those of the encoders."""

    living: Ints
    whole: Ints
    fixed: Array
    state: Array
    line: Array
    at: Ints
    commands: Array
    mode: int
    substeps: int
    seed: np.uint64
    noise: float


@inner_exact
def tell(body: Body, k: int) -> None:
    """Let the command that is old enough come into force."""
    age = len(body.commands)
    if k <= age:
        return
    row = k % age
    for index in range(len(body.living)):
        i = body.living[index]
        body.state[REFERENCE, i] = body.commands[row, i]
        enter(body.whole, body.state, body.line, i, body.mode)


@inner_exact
def measure(body: Body, k: int, q: Array) -> bool:
    """Read the encoders into q (n,); False if they are not finite."""
    total = 0.0
    if body.noise > 0.0:
        add_noise(body.seed, k, body.noise, body.living, body.state[Q], q)
    for index in range(len(body.living)):
        i = body.living[index]
        if body.noise == 0.0:
            q[i] = body.state[Q, i]
        total += abs(q[i])
    return total < math.inf


@inner_exact
def feel_pose(here: Around, memory: Memory, q: Array, torque: Array) -> np.uint64:
    """Fill the sum of J^T (depth * normal) (n,) at q (n,); returns how many contacts there are."""
    for i in range(len(torque)):
        torque[i] = 0.0
    count = find(here, q, memory)
    if count > np.uint64(0):
        feel(here.integers, here.floats, count, here.cut, memory, torque)
    return count


@inner_exact
def respond(law: Law, reaches: Reaches, body: Body, k: int, dt: float, q: Array, torque: Array) -> None:
    """Form the command of tick k."""
    constraint_forces(law.integers, law.floats, q, torque, law.forces[0], law.forces[1], law.forces[2])
    for index in range(len(body.living)):
        i = body.living[index]
        law.total[i] = law.forces[0, i] + law.forces[1, i] + law.forces[2, i] + law.client[i]
    add_all(law.integers, law.floats, reaches, q, law.attractor, dt, law.total)
    command = body.commands[k % len(body.commands)]
    advance(law.integers, law.floats, q, dt, law.attractor, law.total, law.state, command)
    if body.mode != TORQUE:
        row = OWN_REFERENCE if body.mode == POSITION else OWN_VELOCITY
        for index in range(len(body.living)):  # motors of weight 0 among them
            command[body.living[index]] = law.state[row, body.living[index]]


@inner_exact
def move(body: Body, dt: float) -> None:
    """Let the motors run for a tick."""
    step = dt / body.substeps
    for _ in range(body.substeps):
        drive(body.living, body.whole, body.fixed, body.state, body.line, body.at, step)
        integrate(body.living, body.whole, body.fixed, body.state, step)


@inner_exact
def judge(law: Law, reaches: Reaches, parts: Ints, tests: Array, sampled: float) -> bool:
    """Whether an action has ended, by what the encoders said at time `sampled` [s]."""
    ended = False
    for p in range(len(parts)):
        if parts[p, ACTING] == 0:
            continue
        verdict = settle_look(law.settle, tests[p], sampled, law.state, parts[p, FIRST], parts[p, STOP])
        if verdict == SETTLED and goes_on(law.integers, reaches, parts[p, FIRST]):
            continue
        if verdict != MOVING:
            parts[p, ACTING], parts[p, VERDICT] = 0, verdict
            ended = True
    return ended


@inner_exact
def write(body: Body, law: Law, memory: Memory, count: np.uint64, q: Array, row: Array) -> None:
    """Fill a row of the record: encoders, joint sides, commanded velocities, each (n,), and the deepest solid and field [m]."""
    n = len(q)
    for i in range(n):
        row[i], row[n + i], row[2 * n + i] = q[i], body.state[Q, i], law.state[OWN_VELOCITY, i]
    row[3 * n], row[3 * n + 1] = 0.0, 0.0
    for c in range(np.int64(count)):
        kind = memory.found_numbers[c * NUMBERS + 1]
        row[3 * n + kind] = max(row[3 * n + kind], memory.found_reals[c * REALS])


@entry_exact(
    "UniTuple(int64, 2)("
    # the robot in its scene, see `follow`
    "uint64[::1], float64[::1], float64[::1], float64[::1], uint64[::1], float64[::1], float64[::1], int64[::1], int64, int64, "
    "float64, boolean, uint64[::1], float64[::1], float64[::1], uint64[::1], int64[::1], boolean[::1], boolean, "
    # Law
    "int64[::1], float64[::1], float64[::1], float64[:,::1], float64[::1], float64[::1], float64[:,::1], "
    # Reaches
    "int64[:,::1], int64[:,::1], int64[:,:,::1], float64[:,::1], float64[:,:,::1], float64[:,:,::1], "
    # Body
    "int64[::1], int64[:,::1], float64[:,::1], float64[:,::1], float64[:,::1], int64[::1], float64[:,::1], int64, int64, uint64, float64, "
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
    noise: float,
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
    reaches = Reaches(reach_whole, reach_pulled, reach_driven, reach_real, reach_chain, reach_motors)
    body = Body(living, whole, fixed, state, line, at, commands, mode, substeps, np.uint64(seed), noise)
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
