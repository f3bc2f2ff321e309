"""What happens in a tick of the offline plant: commands come into force, encoders, model, law and motors, the look at actions.  Compiled.

See `layout` for the arrays of the motors and parts, `mobee.control.layout` for those of the law.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from mobee.control.law import advance, constraint_forces, settle_look
from mobee.control.layout import MOVING, OWN_VELOCITY, SETTLED
from mobee.control.layout import REFERENCE as OWN_REFERENCE
from mobee.control.marker import PackedReach
from mobee.control.reach_law import add_all, goes_on
from mobee.engine.compiled import inner_exact
from mobee.engine.feel import feel
from mobee.engine.memory import Memory
from mobee.engine.neighbours import Around, find
from mobee.engine.rows import NUMBERS, REALS
from mobee.robot.robot import Array, Ints
from mobee.simulation.drive import drive, enter, integrate
from mobee.simulation.layout import ACTING, FIRST, POSITION, REFERENCE, STOP, TORQUE, VERDICT, Q
from mobee.simulation.noise import add_noise


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
    """The motors: `commands` (age, n) are those on their way, `noise` (n,) [rad or m] and `seed` those of the encoders."""

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
    noise: Array
    noisy: bool


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
    if body.noisy:
        add_noise(body.seed, k, body.noise, body.living, body.state[Q], q)
    for index in range(len(body.living)):
        i = body.living[index]
        if not body.noisy:
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
def respond(law: Law, reaches: PackedReach, body: Body, k: int, dt: float, q: Array, torque: Array) -> None:
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
def judge(law: Law, reaches: PackedReach, parts: Ints, tests: Array, sampled: float) -> bool:
    """Whether an action has ended, by what the encoders said at time `sampled` [s]."""
    ended = False
    for p in range(len(parts)):
        if parts[p, ACTING] == 0:
            continue
        verdict = settle_look(law.floats, law.settle, tests[p], sampled, law.state, parts[p, FIRST], parts[p, STOP])
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
