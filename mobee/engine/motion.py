"""How far shapes may have moved since an earlier pose: as seen from the base, and as seen from a link that carries them."""

from __future__ import annotations

import math

import numpy as np

from mobee.engine.compiled import inner
from mobee.engine.layout import BOUND, CAPSULE, KIND, RADIUS, SLOT
from mobee.engine.pack import I_KIND, I_LINK, I_PARENT, JOINTS, LINKS, SHAPES, Flags, UInts
from mobee.robot.robot import Array

_1, _3, _4, _12, _SLOT = np.uint64(1), np.uint64(3), np.uint64(4), np.uint64(12), np.uint64(SLOT)
_BOUND, _KIND, _RADIUS = np.uint64(BOUND), np.uint64(KIND), np.uint64(RADIUS)


@inner
def find_moved(integers: UInts, angles: Array, last: Array, fresh: bool, moved: Flags) -> None:
    """Mark the links (L,) that are carried by a joint whose angle differs from the last, and remember the angles."""
    moved[0] = fresh
    for j in range(integers[JOINTS]):
        moved[j + _1] = moved[integers[integers[I_PARENT] + j]] or angles[j] != last[j]
        last[j] = angles[j]


@inner
def reach_out(integers: UInts, slots: Array, arm: Array) -> None:
    """Fill how far from a shape's centre its points are that turn with it, (S,) [m]: of a ball none, of a capsule its axis."""
    for i in range(integers[SHAPES]):
        at = i * _SLOT
        arm[i] = slots[at + _BOUND] - (slots[at + _RADIUS] if slots[at + _KIND] <= CAPSULE else 0.0)


@inner
def remember(
    angles: Array,
    frames: Array,
    x: Array,
    y: Array,
    z: Array,
    last: Array,
    then: Array,
    x0: Array,
    y0: Array,
    z0: Array,
    way: Array,
) -> None:
    """Note where everything is: from now on `way` counts from here."""
    for j in range(np.uint64(len(angles))):
        last[j] = angles[j]
    for k in range(np.uint64(len(frames))):
        then[k] = frames[k]
    for i in range(np.uint64(len(x))):
        x0[i], y0[i], z0[i] = x[i], y[i], z[i]
    for i in range(np.uint64(len(way))):
        way[i] = 0.0


@inner
def measure(
    integers: UInts,
    moved: Flags,
    frames: Array,
    then: Array,
    arm: Array,
    x: Array,
    y: Array,
    z: Array,
    x0: Array,
    y0: Array,
    z0: Array,
    enough: float,
    turn: Array,
    way: Array,
) -> float:
    """Fill how far any point of a shape that moved may be from where it was, `way` (S,) [m]; returns the most of all.

    Stops as soon as it is `enough` [m]; what is filled is then of no use.
    """
    most, start = 0.0, integers[I_LINK]
    for i in range(integers[SHAPES]):
        if moved[integers[start + i]]:
            d, e, f = x[i] - x0[i], y[i] - y0[i], z[i] - z0[i]
            length = math.sqrt(d * d + e * e + f * f)
            if length >= enough:
                return length
            way[i] = length
    for link in range(integers[LINKS]):
        if not moved[link]:
            continue
        o, squared = link * _12, 0.0
        for row in range(_3):
            for k in range(o + _4 * row, o + _4 * row + _3):
                squared += (frames[k] - then[k]) * (frames[k] - then[k])
        turn[link] = math.sqrt(0.5 * squared)  # by which a point 1 m from the centre is turned away: 2 sin(angle / 2)
    for i in range(integers[SHAPES]):
        if moved[integers[start + i]]:
            way[i] += turn[integers[start + i]] * arm[i]
        most = max(most, way[i])
    return most


@inner
def bend_links(integers: UInts, angles: Array, then: Array, spans: Array, bend: Array, sway: Array, chain: Array) -> None:
    """Fill for every link three sums over the joints that carry it, from the base on.

    `bend` [rad]: what they have turned since then; `sway` [m]: how far that may have moved the joint of the link;
    `chain` [m]: how far the base is along the joints.  See `swung`.
    """
    bend[0], sway[0], chain[0] = 0.0, 0.0, 0.0
    for j in range(integers[JOINTS]):
        link, parent, change, span = j + _1, integers[integers[I_PARENT] + j], abs(angles[j] - then[j]), spans[j]
        slides = integers[integers[I_KIND] + j] == _1
        span += abs(angles[j]) if slides else 0.0
        bend[link] = bend[parent] + (0.0 if slides else change)
        sway[link] = sway[parent] + bend[parent] * span + (change if slides else 0.0)
        chain[link] = chain[parent] + span


@inner
def swung(link: np.uint64, base: np.uint64, lever: float, bend: Array, sway: Array, chain: Array) -> float:
    """How far a point may have moved that is `lever` from the joint of its link, as seen from a link that carries it [m]."""
    turned = bend[base]
    far: float = sway[link] - sway[base] - turned * (chain[link] - chain[base]) + (bend[link] - turned) * lever
    return far
