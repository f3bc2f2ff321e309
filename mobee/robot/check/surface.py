"""Points on a shape's surface, and how far points are outside of a shape: sampled geometry, for judging fields only."""

from __future__ import annotations

import math

import numpy as np

from mobee.robot.robot import Array, Shape

BALL = 96  # points on a sphere
RING = 24  # points on a circle
GRID = 7  # points along an edge of a box


def surface(shape: Shape) -> Array:
    """Points (k, 3) m on the surface, root frame, zero pose."""
    return np.asarray(shape.position + _local_surface(shape) @ shape.rotation.T)


def outside(shape: Shape, points: Array) -> Array:
    """How far points (k, 3) m, root frame, zero pose, are outside of the shape, (k,) m; zero inside."""
    local = (points - shape.position) @ shape.rotation
    if shape.kind == "convex":  # beyond the nearest of many planes around it
        planes = _sphere(4 * BALL).T
        return np.asarray(np.maximum((local @ planes - (vertices(shape) @ planes).max(axis=0)).max(axis=1), 0.0))
    if shape.kind == "box":
        beyond = np.maximum(np.abs(local) - np.array(shape.size) / 2.0, 0.0)
        return np.asarray(np.linalg.norm(beyond, axis=1))
    radius, half = shape.size[0], shape.size[1] / 2.0 if len(shape.size) > 1 else 0.0
    height = np.maximum(np.abs(local[:, 2]) - half, 0.0)
    across = np.hypot(local[:, 0], local[:, 1])
    if shape.kind == "cylinder":
        return np.asarray(np.hypot(np.maximum(across - radius, 0.0), height))
    return np.asarray(np.maximum(np.hypot(across, height) - radius, 0.0))


def vertices(shape: Shape) -> Array:
    """The vertices (v, 3) m of a convex shape, in its own axes."""
    return np.empty((0, 3)) if shape.vertices is None else shape.vertices


def _local_surface(shape: Shape) -> Array:
    if shape.kind == "convex":
        return vertices(shape)
    if shape.kind == "box":
        steps = np.linspace(-0.5, 0.5, GRID)
        grid = np.stack(np.meshgrid(steps, steps, steps), axis=-1).reshape(-1, 3)
        return np.asarray(grid[np.abs(grid).max(axis=1) == 0.5] * np.array(shape.size))
    radius, half = shape.size[0], shape.size[1] / 2.0 if len(shape.size) > 1 else 0.0
    if shape.kind == "cylinder":
        turn = np.linspace(0.0, 2.0 * np.pi, RING, endpoint=False)
        circle = radius * np.stack([np.cos(turn), np.sin(turn)], axis=1)
        rims = [np.column_stack([circle * share, np.full(RING, z)]) for z in (-half, half) for share in (0.5, 1.0)]
        return np.concatenate([*rims, np.column_stack([circle, np.zeros(RING)])])
    ball = radius * _sphere(BALL)
    return ball if half == 0.0 else ball + np.array([0.0, 0.0, half]) * np.where(ball[:, 2:] >= 0, 1.0, -1.0)


def _sphere(count: int) -> Array:
    """Points spread evenly on the unit sphere (a golden spiral)."""
    k = np.arange(count) + 0.5
    z, turn = 1.0 - 2.0 * k / count, math.pi * (1.0 + math.sqrt(5.0)) * k
    across = np.sqrt(1.0 - z**2)
    return np.stack([across * np.cos(turn), across * np.sin(turn), z], axis=1)
