"""The noise of the encoders: a pure function of seed, tick and motor, so that any process or plant that knows them draws the same.

Counters are mixed as by splitmix64 (Steele, Lea, Flood 2014) and turned into normals by Box and Muller, two at a time.  Compiled.
"""

from __future__ import annotations

import math

import numpy as np

from mobee.engine.compiled import entry_exact, inner_exact
from mobee.robot.robot import Array, Ints

_GOLDEN, _ONE, _TWO = np.uint64(0x9E3779B97F4A7C15), np.uint64(0xBF58476D1CE4E5B9), np.uint64(0x94D049BB133111EB)
_30, _27, _31, _11 = np.uint64(30), np.uint64(27), np.uint64(31), np.uint64(11)
_UNIT = 2.0**-53


@inner_exact
def mixed(x: np.uint64) -> np.uint64:
    """The next state of splitmix64 after x, finished: every bit of x changes each of the result with probability 1/2."""
    x += _GOLDEN
    x = (x ^ (x >> _30)) * _ONE
    x = (x ^ (x >> _27)) * _TWO
    return x ^ (x >> _31)


@inner_exact
def tick_key(seed: np.uint64, k: int) -> np.uint64:
    """What all motors share at tick k."""
    return mixed(mixed(seed) ^ np.uint64(k))


@inner_exact
def normal_pair(key: np.uint64, pair: np.uint64) -> tuple[float, float]:
    """The standard normals of motors 2 pair and 2 pair + 1."""
    one = mixed(key ^ mixed(pair))
    two = mixed(one)
    radius = math.sqrt(-2.0 * math.log((float(one >> _11) + 1.0) * _UNIT))
    angle = 2.0 * math.pi * (float(two >> _11) * _UNIT)
    return radius * math.cos(angle), radius * math.sin(angle)


@inner_exact
def add_noise(seed: np.uint64, k: int, strength: Array, motors: Ints, q: Array, noisy: Array) -> None:
    """Fill `noisy` (n,) for the motors given (m,), ascending: q (n,) plus noise of these standard deviations (n,) [rad or m]."""
    key = tick_key(seed, k)
    last, even, odd = -1, 0.0, 0.0
    for at in range(len(motors)):
        motor = motors[at]
        if motor // 2 != last:
            last = motor // 2
            even, odd = normal_pair(key, np.uint64(last))
        noisy[motor] = q[motor] + strength[motor] * (odd if motor % 2 else even)


@entry_exact("float64[::1](uint64, int64, int64[::1])")
def encoder_noise(seed: int, k: int, motors: Ints) -> Array:
    """Standard normals (m,) of the motors with these indices (m,) at tick k; `seed` counts modulo 2^64."""
    out = np.empty(len(motors))
    key = tick_key(np.uint64(seed), k)
    for at in range(len(motors)):
        even, odd = normal_pair(key, np.uint64(motors[at] // 2))
        out[at] = odd if motors[at] % 2 else even
    return out


@entry_exact("void(uint64, int64, float64[::1], int64[::1], float64[::1], float64[::1])")
def read(seed: int, k: int, strength: Array, motors: Ints, q: Array, noisy: Array) -> None:
    """`add_noise`, for Python."""
    add_noise(np.uint64(seed), k, strength, motors, q, noisy)
