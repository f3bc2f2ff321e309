"""Poses that reach a target: damped least squares with restarts, all of them at once (Wampler 1986).

Many poses, of an arm that is believed to stand elsewhere than its encoders say: `mobee.reachable` and inverse.py find the nearest alone.
"""

from __future__ import annotations

import numpy as np

from experiments.reaching.peer_belief import PeerBelief
from mobee.reach import ReachTarget
from mobee.robot.robot import Array

RESTARTS = 64
STEPS = 40
ENOUGH = 0.5  # of the starts: then the others are not waited for
DAMPING = 0.03  # m/rad
LONGEST = 0.25  # rad a step, of each motor
ARRIVED, ALMOST = 2e-3, 0.01  # m: what may be missing, and what if there is nothing better
KEPT = 12  # of the poses found: those that fields push least away
RETREAT, CLEAR = 0.02, 0.2  # m a step away from the target, and how far at most


def goals(belief: PeerBelief, target: ReachTarget, rng: np.random.Generator, most: int = KEPT, free: bool = False) -> tuple[Array, Array]:
    """Poses with the marker on the target, and poses before them, clear of it, from which the hand goes straight there: (K, d) rad each.

    At most so many, those that fields push least; where joint limits push, only if there are no others, and not if they are to be `free`.
    """
    within = target.radius if target.aim == "surface" else 0.0
    ways = ((belief.limits, ARRIVED), (belief.range, ARRIVED), (belief.range, ALMOST))
    for limits, enough in ways[:1] if free else ways:
        starts = rng.uniform(*limits.T, (RESTARTS, len(limits)))
        found, missing = approach(belief, starts, target.position, within, limits)
        found = found[missing <= enough]
        found = found[belief.sound(found, "grasping")] if len(found) else found
        if len(found):
            break
    found = found[np.argsort(belief.push(found), kind="stable")] if len(found) else found
    poses: list[Array] = []
    befores: list[Array] = []
    for pose in found:
        if len(poses) == most:
            break
        before = retreat(belief, pose, target.position)
        if before is not None:
            poses.append(pose)
            befores.append(before)
    empty = np.zeros((0, len(belief.columns)))
    return np.array(poses) if poses else empty, np.array(befores) if befores else empty


def approach(belief: PeerBelief, starts: Array, place: Array, within: float, limits: Array, steps: int = STEPS) -> tuple[Array, Array]:
    """From starts (K, d) rad draw the marker to within a distance [m] of a place (3,) m, the motors within limits (d, 2).

    Returns poses (K, d), and what is missing, (K,) m.
    """
    q = starts.copy()
    low, high = limits.T
    for _ in range(steps):
        whole = belief.whole(q)
        way, missing = _way(belief, whole, place, within)
        if (missing <= 0.1 * ARRIVED).mean() >= ENOUGH:
            break
        jacobian = belief.model.jacobian(whole, belief.marker)[:, :3, belief.columns]
        damped = jacobian @ jacobian.transpose(0, 2, 1) + DAMPING**2 * np.eye(3)
        step = np.einsum("kij,ki->kj", jacobian, np.linalg.solve(damped, way[..., None])[..., 0])
        step *= np.minimum(1.0, LONGEST / np.maximum(np.abs(step).max(axis=1, keepdims=True), 1e-12))
        q = np.clip(q + step, low, high)
    return q, _way(belief, belief.whole(q), place, within)[1]


def retreat(belief: PeerBelief, pose: Array, place: Array) -> Array | None:
    """A pose on the straight way of the marker, and the hand with it, out of the target: the first that no field feels, else no solid."""
    whole = belief.whole(pose)
    here = belief.model.evaluate(whole).position(belief.marker)
    out = here - place
    out = out / max(float(np.linalg.norm(out)), 1e-9)
    q, found = pose, None
    for step in range(1, round(CLEAR / RETREAT) + 1):
        before = q
        q = approach(belief, q[None], here + step * RETREAT * out, 0.0, belief.range, steps=4)[0][0]
        if not belief.sound_motion(before, q, "grasping"):
            break
        if belief.sound(q[None], "solids" if found is None else "fields")[0] and belief.sound_motion(q, pose, "grasping"):
            if found is not None or belief.sound(q[None], "fields")[0]:
                return q
            found = q
    return found


def _way(belief: PeerBelief, whole: Array, place: Array, within: float) -> tuple[Array, Array]:
    """From the marker to what is within that distance of the place, (K, 3) m, and how long it is, (K,)."""
    way = place - belief.model.evaluate(whole).position(belief.marker)
    distance = np.linalg.norm(way, axis=1)
    missing = np.maximum(distance - within, 0.0)
    return way * (missing / np.maximum(distance, 1e-12))[:, None], missing
