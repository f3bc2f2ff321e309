"""What the motors are told: velocities [rad/s], tick by tick, for a motor that has ROOM on both sides of where it starts."""

from __future__ import annotations

import numpy as np

from mobee.robot.robot import Array

DT = 0.01  # s, a tick
ROOM = np.deg2rad(14.0)  # rad, no signal goes farther from its start
SPEEDS = np.deg2rad([5.0, 10.0, 20.0, 40.0])  # rad/s, of the steps
REACH = np.deg2rad(11.0)  # rad, that a random signal keeps to, its lag not counted
PRELOAD = 60  # ticks at the beginning that take up the play in the positive direction; they are not fitted


def fitted_signal() -> Array:
    """Steps of four sizes and both signs, reversals without rest, slow ramps through zero; shape (ticks,)."""
    parts = [_preload()]
    for speed in SPEEDS:
        parts += [_hold(speed, 0.3), _hold(0.0, 0.3), _hold(-speed, 0.3), _hold(0.0, 0.3)]
    swing = np.deg2rad(10.0)
    parts += [_hold(swing, 0.2), *(_hold(sign * swing, 0.4) for sign in (-1.0, 1.0) * 3), _hold(-swing, 0.2), _hold(0.0, 0.3)]
    slow = np.deg2rad(4.0)
    up, down = np.linspace(-slow, slow, 150), np.linspace(slow, -slow, 150)
    parts += [up, down, _hold(0.0, 0.3)]
    return np.concatenate(parts)


def held_out_signal(rng: np.random.Generator) -> Array:
    """Random steps of random length, 4 s; no fit sees them."""
    parts, position = [_preload()], 0.0
    while sum(map(len, parts)) * DT < 4.0:
        speed, duration = np.deg2rad(rng.uniform(-40.0, 40.0)), rng.uniform(0.05, 0.4)
        if position * speed > 0.0 and abs(position + speed * duration) > REACH:
            speed = -speed
        if rng.random() < 0.2 or abs(position + speed * duration) > REACH:
            speed = 0.0
        parts.append(_hold(speed, duration))
        position += speed * len(parts[-1]) * DT
    return np.concatenate(parts)


def _preload() -> Array:
    return np.concatenate([_hold(0.0, 0.1), _hold(np.deg2rad(5.0), 0.2), _hold(0.0, 0.3)])


def _hold(speed: float, duration: float) -> Array:
    return np.full(round(duration / DT), speed)
