"""Directions to look in, spread evenly."""

from __future__ import annotations

import math

import numpy as np

from mobee.robot.robot import Array

COUNT = {1: 2, 2: 24, 3: 64}  # of a task space of so many dimensions; more dimensions: 128
_MOST = 128


def directions(dimensions: int) -> Array:
    """Unit vectors (D, dimensions): both in 1-D, a circle in 2-D, a spiral over the sphere in 3-D, drawn and opposite ones beyond."""
    count = COUNT.get(dimensions, _MOST)
    if dimensions == 1:
        return np.array([[1.0], [-1.0]])
    if dimensions == 2:
        angle = 2.0 * math.pi * np.arange(count) / count
        return np.stack([np.cos(angle), np.sin(angle)], axis=1)
    if dimensions == 3:
        height = 1.0 - (2.0 * np.arange(count) + 1.0) / count
        turn = math.pi * (3.0 - math.sqrt(5.0)) * np.arange(count)
        radius = np.sqrt(1.0 - height**2)
        return np.stack([radius * np.cos(turn), radius * np.sin(turn), height], axis=1)
    drawn = np.random.default_rng(0).standard_normal((count // 2, dimensions))
    half: Array = drawn / np.sqrt((drawn**2).sum(axis=1, keepdims=True))
    return np.concatenate([half, -half])
