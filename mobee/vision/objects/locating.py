# SPDX-License-Identifier: Apache-2.0
"""Locates all things that two cameras see: finds the detections that belong to the same thing, and computes its position."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mobee.arrays import Array
from mobee.model.world_object import WorldObject
from mobee.vision.objects.detection import Detection
from mobee.vision.objects.placing import FARTHEST, NEAREST, Eye, Eyes, Outline, Placed, place
from mobee.vision.objects.thing import Thing, surface

GAP = 0.03  # m between the rays through the middles of two outlines
LIKELY_SIZE = (0.5, 2.0)  # of the usual diameter: what two outlines may have by their areas
SUNK = 0.012  # m by which a thing may reach into a known solid, beside three standard deviations
APART = 0.5  # of the sum of two things' half diameters: nearer things are the same one, seen twice


def locate_all(
    things: Sequence[Thing], detections: Mapping[str, Sequence[Detection]], eyes: Eyes, solids: Sequence[WorldObject] = ()
) -> list[Placed]:
    """Return the positions of all things that both cameras see, the thing whose shape fits the two outlines best first.

    Args:
        things: the things that may be seen.
        detections: the detections in each picture, by name of the camera.
        eyes: the two cameras, with their poses at the time stamp of the pictures.
        solids: known boxes.  A thing whose computed shape clearly reaches into a box is left out: it may be only a flat picture on the box.
    """
    found: list[tuple[Placed, Thing, int, int]] = []
    first, second = eyes.names
    outlines = {name: Outline.all_of(eye, detections[name]) for name, eye in zip(eyes.names, eyes.eyes, strict=True)}
    sights = {name: _Sights.of(eye, detections[name], outlines[name]) for name, eye in zip(eyes.names, eyes.eyes, strict=True)}
    for thing in things:
        for a, b in _pairs(thing, sights[first], sights[second]):
            placed = place(thing, (outlines[first][a], outlines[second][b]), eyes)
            if placed is not None and not any(_reaches_into(thing, placed, solid) for solid in solids):
                found.append((placed, thing, a, b))
    chosen: list[tuple[Placed, Thing]] = []
    used: set[tuple[str, int]] = set()
    for placed, thing, a, b in sorted(found, key=lambda one: one[0].misfit / one[0].share):
        apart = all(np.linalg.norm(placed.position - other.position) > APART * (_half(thing) + _half(kind)) for other, kind in chosen)
        if apart and not {(first, a), (second, b)} & used:
            used |= {(first, a), (second, b)}
            chosen.append((placed, thing))
    return [placed for placed, _ in chosen]


def _half(thing: Thing) -> float:
    """Return half of the mean diameter of a thing, m."""
    return {"sphere": thing.size[0], "cylinder": 0.25 * (2.0 * thing.size[0] + thing.size[-1]), "box": float(np.mean(thing.size)) * 0.5}[
        thing.kind
    ]


@dataclass(frozen=True, slots=True, eq=False)
class _Sights:
    """The detections of one picture: optical centre (3,) m, rays (D, 3) through their middles, angles (D,) rad of discs of their areas."""

    names: NDArray[np.str_]
    origin: Array
    rays: Array
    angles: Array

    @classmethod
    def of(cls, eye: Eye, detections: Sequence[Detection], outlines: Sequence[Outline]) -> _Sights:
        rays = np.array([one.ray for one in outlines]).reshape(-1, 3)
        angles = np.array([2.0 * np.sqrt(one.area / np.pi) / eye.lens.fx for one in detections])
        return cls(np.array([one.name for one in detections]), eye.position, rays, angles)


def _pairs(thing: Thing, left: _Sights, right: _Sights) -> list[tuple[int, int]]:
    """Return which detections of a thing may be the same one: their rays meet, where things of their areas may be."""
    base, cross = right.origin - left.origin, left.rays @ right.rays.T  # (A, B)
    one, other = (left.rays @ base)[:, None], right.rays @ base
    with np.errstate(invalid="ignore", divide="ignore"):
        near, far = (one - cross * other) / (1.0 - cross**2), (cross * one - other) / (1.0 - cross**2)  # distances along the rays
        gap = np.linalg.norm(base + far[..., None] * right.rays - near[..., None] * left.rays[:, None], axis=-1)
        low, high = (factor * 2.0 * _half(thing) for factor in LIKELY_SIZE)
        fits = gap < GAP
        for distance, angle in ((near, left.angles[:, None]), (far, right.angles)):
            fits &= (distance > NEAREST) & (distance < FARTHEST) & (distance * angle > low) & (distance * angle < high)
    fits &= (left.names == thing.name)[:, None] & (right.names == thing.name)
    return [(int(a), int(b)) for a, b in np.argwhere(fits)]


def _reaches_into(thing: Thing, placed: Placed, solid: WorldObject) -> bool:
    """Return whether a thing reaches into a box farther than its place may be wrong."""
    if solid.kind != "box":
        return False
    points: Array = placed.position + surface(thing.kind, placed.size) @ placed.rotation.T
    local = (points - solid.position) @ solid.rotation
    depth = 0.5 * np.array(solid.size) - np.abs(local)
    face = int(depth[depth.min(axis=1).argmax()].argmin())
    normal = solid.rotation[:, face]
    deviation = float(np.sqrt(normal @ placed.covariance @ normal))
    return float(depth.min(axis=1).max()) > SUNK + 3.0 * deviation
