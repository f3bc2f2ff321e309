"""Where the links of the toy arm are, and how far its hand comes by damped least squares."""

from __future__ import annotations

import numpy as np

from mobee.robot.robot import Array

UPPER, FORE = 0.152, 0.20  # m: shoulder to elbow, elbow to palm
TETHER = 0.5  # rad: how far a reach leaves its pose, a joint
STEPS, DAMPING, PULL = 30, 0.02, 0.6  # of the least squares; DAMPING in m
WAYPOINTS = 9  # poses of an action's way that are looked at
AWAY = 0.005  # m: an arm that is in the way already may leave


def hands(poses: Array) -> Array:
    """Where the palm is, (..., 3) m from the shoulder, at poses (..., 4) rad: shoulder pitch, roll, yaw, elbow."""
    upper, fore = _links(poses)
    return upper + fore


def missing(starts: Array, target: Array, ranges: Array) -> Array:
    """How far the palm ends from a target (3,) m, shape (...), in m, reaching from poses (..., 4) rad within ranges (4, 2) rad."""
    low, high = np.maximum(starts - TETHER, ranges[:, 0]), np.minimum(starts + TETHER, ranges[:, 1])
    q = np.clip(starts, low, high)
    for _ in range(STEPS):
        hand, jacobian = hands(q), jacobians(q)
        square = jacobian @ np.swapaxes(jacobian, -1, -2) + DAMPING**2 * np.eye(3)
        pulled = np.linalg.solve(square, (target - hand)[..., None])
        q = np.clip(q + PULL * (np.swapaxes(jacobian, -1, -2) @ pulled)[..., 0], low, high)
    distance: Array = np.linalg.norm(target - hands(q), axis=-1)
    return distance


def jacobians(poses: Array) -> Array:
    """Derivatives of the palm's place, shape (..., 3, 4), by central differences."""
    step = 1e-6
    return np.stack([(hands(poses + step * unit) - hands(poses - step * unit)) / (2.0 * step) for unit in np.eye(4)], axis=-1)


def swept(starts: Array, ends: Array, point: Array, clearance: float) -> Array:
    """Whether the arm comes nearer than that [m] to a point (3,) m, and nearer than it was, shape (S, A).

    The ways are straight, from poses (S, 4) to (S, A, 4) rad.
    """
    shares = np.linspace(0.0, 1.0, WAYPOINTS)[:, None]
    upper, fore = _links(starts[:, None, None] + shares * (ends - starts[:, None])[:, :, None])
    near = np.minimum(_distance(np.zeros(3), upper, point), _distance(upper, fore, point))
    return near.min(axis=-1) < np.minimum(clearance, near[..., 0] - AWAY)


def _links(poses: Array) -> tuple[Array, Array]:
    """The upper arm and the forearm as vectors, (..., 3) m each: x forward, y outward, z up."""
    pitch, roll, yaw, elbow = np.moveaxis(np.asarray(poses), -1, 0)
    none, bent = np.zeros_like(pitch), np.sin(elbow)
    upper = np.stack([none, none, np.full_like(pitch, -UPPER)], axis=-1)
    fore = FORE * np.stack([bent * np.cos(yaw), bent * np.sin(yaw), -np.cos(elbow)], axis=-1)
    return _turned(upper, pitch, roll), _turned(fore, pitch, roll)


def _turned(vector: Array, pitch: Array, roll: Array) -> Array:
    x, y, z = np.moveaxis(vector, -1, 0)
    y, z = np.cos(roll) * y - np.sin(roll) * z, np.sin(roll) * y + np.cos(roll) * z
    return np.stack([np.cos(pitch) * x + np.sin(pitch) * z, y, np.cos(pitch) * z - np.sin(pitch) * x], axis=-1)


def _distance(start: Array, along: Array, point: Array) -> Array:
    """From a point to line pieces, shape (...)."""
    share = np.clip(((point - start) * along).sum(axis=-1) / (along**2).sum(axis=-1), 0.0, 1.0)
    gap: Array = np.linalg.norm(start + share[..., None] * along - point, axis=-1)
    return gap
