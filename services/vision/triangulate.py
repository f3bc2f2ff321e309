"""Triangulates two sightings: the point closest to both rays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mobee.arrays import Array
from services.vision.ball import Sighting

Frame = tuple[Array, Array]  # optical centre (3,) m; rotation (3, 3), columns right, down, forward; root frame

MAX_GAP = 0.015  # m between the two rays: more is not the same thing seen twice
MAX_SIZE_ERROR = 0.2  # of the distance, between what size and what parallax say
REACH = (0.08, 1.5)  # m, from an eye
RAY_ERROR = 0.003  # rad, standard deviation: a third of a pixel, and the encoders' noise along neck and torso


@dataclass(frozen=True, slots=True, eq=False)
class Fix:
    """A ball in the root frame."""

    position: Array  # (3,) m
    covariance: Array  # (3, 3) m^2
    gap: float  # m, between the two rays


def locate(left: Sequence[Sighting], right: Sequence[Sighting], frames: tuple[Frame, Frame], radius: float) -> Fix | None:
    """The pair of sightings that agrees best about where a ball of this radius [m] is; None when no pair does."""
    fixes = [fix for a in left for b in right if (fix := triangulate(a, b, frames, radius)) is not None]
    return min(fixes, key=lambda fix: fix.gap, default=None)


def triangulate(left: Sighting, right: Sighting, frames: tuple[Frame, Frame], radius: float) -> Fix | None:
    """Where two sightings place the ball; None if their rays pass each other, or the size contradicts the distance."""
    origins = np.array([frame[0] for frame in frames])
    rays = np.array([frame[1] @ seen.direction for frame, seen in zip(frames, (left, right), strict=True)])
    across = np.eye(3) - rays[:, :, None] * rays[:, None, :]  # (2, 3, 3): what a ray says nothing about is along it
    normal = across.sum(axis=0)
    if np.linalg.cond(normal) > 1e6:
        return None  # parallel: infinitely far
    position = np.linalg.solve(normal, np.einsum("eij,ej->i", across, origins))
    offsets = position - origins
    distances = np.linalg.norm(offsets, axis=1)
    misses = np.linalg.norm(np.einsum("eij,ej->ei", across, offsets), axis=1)
    by_size = np.array([left.distance(radius), right.distance(radius)])
    ahead = np.einsum("ei,ei->e", rays, offsets) > 0.0
    near_enough = (distances > REACH[0]) & (distances < REACH[1])
    if not (ahead & near_enough).all() or misses.sum() > MAX_GAP or (np.abs(by_size / distances - 1.0) > MAX_SIZE_ERROR).any():
        return None
    information = np.einsum("eij,e->ij", across, 1.0 / (RAY_ERROR * distances) ** 2)
    return Fix(position, np.linalg.inv(information), float(misses.sum()))
