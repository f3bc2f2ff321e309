"""The whole law, compiled once, for the controller and for the offline plant's loop: forces, a step, the settle test.

All of it works on a packed law (`pack`) and a state (STATE, n), see `layout`; the inner functions allocate nothing.
"""

from __future__ import annotations

import math

import numpy as np

from mobee.control.client import add_client_force
from mobee.control.collision import collision_forces
from mobee.control.constraints import clause_forces
from mobee.control.dynamics import acceleration, bounded, led
from mobee.control.layout import (
    ACCELERATION,
    ACTIVE,
    BEGUN,
    DAMPING,
    F_MOTOR,
    FEEDFORWARD,
    FELT,
    FINE,
    HIGH,
    I_ACTIVE,
    I_FELT,
    INTERVAL,
    LOW,
    MAX_ACCELERATION,
    MAX_SPEED,
    MAX_SPRING,
    MAX_TORQUE,
    MODALITY,
    MOTOR,
    MOTORS,
    MOVING,
    NEXT_LOOK,
    OWN_ACCELERATION,
    OWN_VELOCITY,
    POSITION,
    REACH,
    REFERENCE,
    SENT,
    SETTLED,
    SPEED,
    STATE,
    STIFFNESS,
    TIMED_OUT,
    TIMEOUT,
    TORQUE,
    VELOCITY,
)
from mobee.control.limits import limit_forces
from mobee.control.modality import FRICTION, INERTIA
from mobee.engine.compiled import entry_exact, inner_exact
from mobee.robot.robot import Array, Ints

_ROUNDING = 1e-9  # s, times are sums of ticks


@inner_exact
def constraint_forces(integers: Ints, floats: Array, q: Array, torque: Array, limits: Array, constraints: Array, collision: Array) -> None:
    """Fill f_lim, f_cst and f_coll of eq. 5.7, each (n,) in rad/s^2, at q (n,) rad.

    `torque` (n,): the sum of J^T (depth * normal) over the contacts of fields, over the whole tree or cut at the parts.
    """
    for i in range(integers[MOTORS]):
        limits[i] = constraints[i] = collision[i] = 0.0
    limit_forces(integers, floats, q, limits)
    clause_forces(integers, floats, q, constraints)
    collision_forces(integers, floats, torque, collision)


@inner_exact
def rest(integers: Ints, floats: Array, q: Array, state: Array, command: Array) -> None:
    """Begin at rest at the measured q (n,) rad: fill the state, and the command (n,) of motors that are never moved."""
    for i in range(integers[MOTORS]):
        o = F_MOTOR + i * MOTOR
        for row in range(STATE):
            state[row, i] = 0.0
        state[REFERENCE, i] = min(max(q[i], floats[o + LOW]), floats[o + HIGH])
        command[i] = state[REFERENCE, i] if integers[MODALITY] == POSITION else 0.0
    for k in range(integers[ACTIVE]):
        i = integers[integers[I_ACTIVE] + k]
        state[REFERENCE, i] = q[i]


@inner_exact
def advance(integers: Ints, floats: Array, q: Array, dt: float, attractor: Array, force: Array, state: Array, command: Array) -> None:
    """One step of eq. 5.7 by dt [s] from the measured q (n,) rad, and the command (n,) in the law's modality.

    `force` (n,) rad/s^2: the sum of the right-hand side.  Motors that are never moved keep their state and their command, but in
    torque modality they too are told the torque that is fed forward.
    """
    for k in range(integers[ACTIVE]):
        i = integers[integers[I_ACTIVE] + k]
        o = F_MOTOR + i * MOTOR
        own = state[OWN_VELOCITY, i]
        a = acceleration(q[i], own, attractor[i], force[i], floats[o + STIFFNESS], floats[o + MAX_SPRING], floats[o + DAMPING])
        v = bounded(own + a * dt, state[SENT, i], floats[o + MAX_SPEED], floats[o + MAX_ACCELERATION] * dt)
        state[OWN_ACCELERATION, i] = (v - state[SENT, i]) / dt  # of what is sent: after `hold` the own velocity is 0 and that is not
        state[OWN_VELOCITY, i] = v
        state[SENT, i] = v
        state[REFERENCE, i] = led(state[REFERENCE, i], q[i], v, dt, floats[o + REACH], floats[o + LOW], floats[o + HIGH])
        if integers[MODALITY] == POSITION:
            command[i] = state[REFERENCE, i]
        elif integers[MODALITY] == VELOCITY:
            command[i] = v
    if integers[MODALITY] == TORQUE:
        for k in range(integers[FELT]):
            i = integers[integers[I_FELT] + k]
            command[i] = torque_of(floats, i, state)


@inner_exact
def torque_of(floats: Array, motor: int, state: Array) -> float:
    """The torque [N m] that gives a motor its velocity and acceleration and carries what is fed forward, within its maximum."""
    wanted = INERTIA * state[OWN_ACCELERATION, motor] + FRICTION * state[OWN_VELOCITY, motor] + state[FEEDFORWARD, motor]
    most = floats[F_MOTOR + motor * MOTOR + MAX_TORQUE]
    return min(max(wanted, -most), most)


@inner_exact
def is_time(settle: Array, test: Array, t: float) -> bool:
    """Whether the motion is looked at, at time t [s]; then the time of the next look is noted."""
    if t < test[NEXT_LOOK] - _ROUNDING:
        return False
    missed = math.floor((t - test[NEXT_LOOK] + _ROUNDING) / settle[INTERVAL])
    test[NEXT_LOOK] += (missed + 1) * settle[INTERVAL]
    return True


@inner_exact
def is_slow(settle: Array, velocity: float, change: float, unit: float) -> bool:
    """Whether a motor that is commanded so counts as at rest; `unit`: what 1 rad of the thresholds is for it."""
    return abs(velocity) <= settle[SPEED] * unit and abs(change) <= settle[ACCELERATION] * unit


@inner_exact
def unsettled(settle: Array, test: Array, t: float) -> int:
    """What a part is that has not settled by time t [s]: MOVING or TIMED_OUT."""
    return TIMED_OUT if t - test[BEGUN] >= settle[TIMEOUT] - _ROUNDING else MOVING


@inner_exact
def settle_look(floats: Array, settle: Array, test: Array, t: float, state: Array, first: int, stop: int) -> int:
    """Judge the motion of the motors first to stop at time t [s]: MOVING, SETTLED or TIMED_OUT; between two looks always moving."""
    if is_time(settle, test, t):
        slow = True
        for i in range(first, stop):
            slow = slow and is_slow(settle, state[OWN_VELOCITY, i], state[OWN_ACCELERATION, i], floats[F_MOTOR + i * MOTOR + FINE])
        if slow:
            return SETTLED
    return unsettled(settle, test, t)


@entry_exact("Tuple((float64[::1], float64[::1], float64[::1]))(int64[::1], float64[::1], float64[::1], float64[::1])")
def forces_at(integers: Ints, floats: Array, q: Array, torque: Array) -> tuple[Array, Array, Array]:
    """What `constraint_forces` fills, in new arrays."""
    limits, constraints, collision = np.empty(len(q)), np.empty(len(q)), np.empty(len(q))
    constraint_forces(integers, floats, q, torque, limits, constraints, collision)
    return limits, constraints, collision


@entry_exact("float64[:,::1](int64[::1], float64[::1], float64[::1])")
def at_rest(integers: Ints, floats: Array, q: Array) -> Array:
    """The state of `rest`, a new array."""
    state = np.empty((STATE, len(q)))
    rest(integers, floats, q, state, np.empty(len(q)))
    return state


@entry_exact("float64[:,::1](int64[::1], float64[::1], float64[::1], float64, float64[::1], float64[::1], float64[:,::1])")
def step(integers: Ints, floats: Array, q: Array, dt: float, attractor: Array, force: Array, state: Array) -> Array:
    """`advance` a state, which changes, and give the commands in all modalities, in a new array: position, velocity, torque."""
    commands = np.empty((3, len(q)))
    advance(integers, floats, q, dt, attractor, force, state, commands[0])
    for i in range(len(q)):
        commands[0, i] = state[REFERENCE, i]
        commands[1, i] = state[OWN_VELOCITY, i]
        commands[2, i] = torque_of(floats, i, state)
    return commands


@entry_exact("void(int64[::1], float64[::1], float64[::1], float64[::1])")
def add_client(integers: Ints, floats: Array, f: Array, total: Array) -> None:
    """Add L(f), f_config or f_work (eqs. 5.9 and 5.10), to a total, both (n,)."""
    add_client_force(integers, floats, f, total)


@entry_exact("int64(float64[::1], float64[::1], float64, float64[:,::1])")
def look(settle: Array, test: Array, t: float, motion: Array) -> int:
    """`settle_look` at commanded velocities and accelerations, (2, k), divided by FINE of the motors."""
    if is_time(settle, test, t):
        slow = True
        for i in range(motion.shape[1]):
            slow = slow and is_slow(settle, motion[0, i], motion[1, i], 1.0)
        if slow:
            return SETTLED
    return unsettled(settle, test, t)
