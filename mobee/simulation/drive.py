"""A substep of the motors: what a command becomes on the motor side, and what the joint side becomes of that.  Compiled.

See `layout` for the arrays; `motors` (m,) are those that live, in ascending order: the others rest.
"""

from __future__ import annotations

from mobee.control.modality import FRICTION as VISCOUS
from mobee.control.modality import INERTIA
from mobee.engine.compiled import entry_exact, inner_exact
from mobee.robot.robot import Array, Ints
from mobee.simulation.layout import (
    DELAY,
    DRAGGED,
    EFFORT,
    FRICTION,
    HIGH,
    HOLD,
    LEFT,
    LOAD,
    LOW,
    MAX_ACCELERATION,
    MAX_TORQUE,
    MAX_VELOCITY,
    MODE,
    MOTOR_Q,
    MOTOR_V,
    PLAY,
    POSITION,
    REFERENCE,
    REST,
    RESTING,
    SERVO_GAIN,
    SHARE,
    TORQUE,
    VELOCITY,
    Q,
)


@inner_exact
def within(x: float, low: float, high: float) -> float:
    """The nearest to x of low .. high; NaN stays."""
    return low if x < low else (high if x > high else x)


@inner_exact
def shrunk(x: float, by: float) -> float:
    """The number nearer to 0 by that much, at most 0."""
    return x - by if x > by else (x + by if x < -by else x * 0.0)


@inner_exact
def enter(whole: Ints, state: Array, line: Array, motor: int, mode: int) -> None:
    """Change a motor's mode; what is on its way to it has another unit and becomes what it does now: in torque mode, carry its load.

    From then on its gear is rigid: the motor side stands where the joint is.
    """
    if whole[MODE, motor] == mode:
        return
    whole[MODE, motor] = mode
    whole[RESTING, motor] = 0
    for row in range(len(line)):
        line[row, motor] = state[LOAD, motor] if mode == TORQUE else state[MOTOR_V, motor]
    if mode == TORQUE:
        state[MOTOR_Q, motor] = state[Q, motor]


@inner_exact
def servo(fixed: Array, state: Array, motor: int, position: float) -> float:
    """The velocity [rad/s] towards a position [rad]."""
    most = fixed[MAX_VELOCITY, motor]
    return within(SERVO_GAIN * (position - state[MOTOR_Q, motor]), -most, most)


@inner_exact
def wanted(whole: Ints, fixed: Array, state: Array, motor: int) -> float:
    """What enters the delay line: a torque [N m] in torque mode, else a velocity [rad/s]."""
    reference = state[REFERENCE, motor]
    if whole[MODE, motor] == POSITION:
        return servo(fixed, state, motor, reference)
    most = fixed[MAX_TORQUE if whole[MODE, motor] == TORQUE else MAX_VELOCITY, motor]
    return within(reference, -most, most)


@inner_exact
def turned(fixed: Array, state: Array, motor: int, torque: float, dt: float) -> float:
    """The velocity [rad/s] after a substep under a torque [N m]."""
    most, before = fixed[MAX_ACCELERATION, motor], state[MOTOR_V, motor]
    push = within((torque - state[LOAD, motor] - VISCOUS * before) / INERTIA, -most, most)
    slowed = before + push * dt
    if fixed[FRICTION, motor] > 0.0:
        slowed = shrunk(slowed, VISCOUS * fixed[FRICTION, motor] / INERTIA * dt)
    return within(slowed, -fixed[MAX_VELOCITY, motor], fixed[MAX_VELOCITY, motor])


@inner_exact
def responded(fixed: Array, state: Array, motor: int, velocity: float) -> float:
    """The velocity [rad/s] after a substep in which one was asked for: first order, less what Coulomb friction takes."""
    share = fixed[SHARE, motor]
    after: float = state[MOTOR_V, motor] + share * (velocity - state[MOTOR_V, motor])
    return shrunk(after, share * fixed[FRICTION, motor]) if fixed[FRICTION, motor] > 0.0 else after


@inner_exact
def held(whole: Ints, fixed: Array, state: Array, motor: int, dt: float) -> float:
    """The velocity [rad/s] of a motor that brakes to rest and then stays where that was."""
    before, change = state[MOTOR_V, motor], fixed[MAX_ACCELERATION, motor] * dt
    if whole[RESTING, motor] == 0 and abs(before) <= change:
        whole[RESTING, motor] = 1
        state[REST, motor] = state[MOTOR_Q, motor]
    if whole[RESTING, motor] == 1:
        return servo(fixed, state, motor, state[REST, motor])
    braked: float = before - within(before, -change, change)
    return braked


@inner_exact
def drive(motors: Ints, whole: Ints, fixed: Array, state: Array, line: Array, at: Ints, dt: float) -> None:
    """Advance the motor sides by a substep of dt [s].  `line` (rows, n): what is on its way; `at` (1,): the row written last."""
    rows = len(line)
    now = at[0] + 1 if at[0] + 1 < rows else 0
    at[0] = now
    for index in range(len(motors)):
        i = motors[index]
        mode, before = whole[MODE, i], state[MOTOR_V, i]
        line[now, i] = wanted(whole, fixed, state, i)
        then = now - whole[DELAY, i]
        asked = line[then if then >= 0 else then + rows, i]
        state[LEFT, i] = asked if mode == TORQUE else 0.0
        if mode == HOLD:
            after = held(whole, fixed, state, i, dt)
        elif mode == TORQUE:
            after = turned(fixed, state, i, asked, dt)
        else:
            after = responded(fixed, state, i, asked)
        state[EFFORT, i] = INERTIA * (after - before) / dt + VISCOUS * after
        state[MOTOR_V, i] = after
        state[MOTOR_Q, i] += after * dt
        play = 0.0 if mode == TORQUE else fixed[PLAY, i]  # who commands torques takes the gear to be rigid
        state[DRAGGED, i] = within(state[Q, i], state[MOTOR_Q, i] - play, state[MOTOR_Q, i] + play)


@inner_exact
def adopt(motors: Ints, whole: Ints, fixed: Array, state: Array, q: Array, dt: float) -> None:
    """Take the joint side (n,) rad at the end of a substep of dt [s]; the motor side follows into the play."""
    for index in range(len(motors)):
        i = motors[index]
        state[VELOCITY, i] = (q[i] - state[Q, i]) / dt
        state[Q, i] = q[i]
        if whole[MODE, i] == TORQUE:
            state[MOTOR_Q, i], state[MOTOR_V, i] = q[i], state[VELOCITY, i]
        else:
            state[MOTOR_Q, i] = within(state[MOTOR_Q, i], q[i] - fixed[PLAY, i], q[i] + fixed[PLAY, i])


@inner_exact
def integrate(motors: Ints, whole: Ints, fixed: Array, state: Array, dt: float) -> None:
    """Kinematic joint sides: go where `drive` pulled, as far as the hard stops."""
    for index in range(len(motors)):
        i = motors[index]
        state[DRAGGED, i] = within(state[DRAGGED, i], fixed[LOW, i], fixed[HIGH, i])
    adopt(motors, whole, fixed, state, state[DRAGGED], dt)


@entry_exact("void(int64[::1], int64[:,::1], float64[:,::1], float64[:,::1], int64)")
def enter_all(motors: Ints, whole: Ints, state: Array, line: Array, mode: int) -> None:
    """`enter` for each of the motors."""
    for index in range(len(motors)):
        enter(whole, state, line, motors[index], mode)


@entry_exact("void(int64[::1], int64[:,::1], float64[:,::1], float64[:,::1], float64[:,::1], int64[::1], float64)")
def drive_all(motors: Ints, whole: Ints, fixed: Array, state: Array, line: Array, at: Ints, dt: float) -> None:
    """`drive`, for Python."""
    drive(motors, whole, fixed, state, line, at, dt)


@entry_exact("void(int64[::1], int64[:,::1], float64[:,::1], float64[:,::1], float64[::1], float64)")
def adopt_all(motors: Ints, whole: Ints, fixed: Array, state: Array, q: Array, dt: float) -> None:
    """`adopt`, for Python."""
    adopt(motors, whole, fixed, state, q, dt)


@entry_exact("void(int64[::1], int64[:,::1], float64[:,::1], float64[:,::1], float64)")
def integrate_all(motors: Ints, whole: Ints, fixed: Array, state: Array, dt: float) -> None:
    """`integrate`, for Python."""
    integrate(motors, whole, fixed, state, dt)
