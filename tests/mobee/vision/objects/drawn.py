# SPDX-License-Identifier: Apache-2.0
"""Two eyes before a table, and the exact outlines of things that they see."""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull

from mobee.vision.lens import DRAGONFLY
from mobee.vision.objects.detection import Detection
from mobee.vision.objects.placing import Eye, Eyes, Placed
from mobee.vision.objects.thing import Thing, surface, touching, upright

BALL = Thing("ball", "sphere", (0.03,), (0.9, 0.05, 0.05))
CUP = Thing("cup", "cylinder", (0.035, 0.09), (0.05, 0.3, 0.85))
BOX = Thing("box", "box", (0.06, 0.05, 0.08), (0.1, 0.6, 0.15))
THINGS = (BALL, CUP, BOX)
TURNS, SHIFTS = 0.002, 0.0005  # rad and m: standard deviations of the cameras' errors


def eyes(height: float = 0.35) -> Eyes:
    """Two eyes 68 mm apart, that look down by 45 degrees along -x, with errors that are half noise and half bias."""
    ahead = np.array([-1.0, 0.0, -1.0]) / np.sqrt(2.0)
    right = np.array([0.0, 1.0, 0.0])
    rotation = np.stack([right, np.cross(ahead, right), ahead], axis=1)
    both = tuple(Eye(np.array([0.0, side * 0.034, height]), rotation, DRAGONFLY) for side in (-1.0, 1.0))
    factor = np.diag(np.tile([SHIFTS] * 3 + [TURNS] * 3, 2)) / np.sqrt(2.0)
    return Eyes(("left", "right"), both, factor, factor)


def outline(thing: Thing, position: np.ndarray, yaw: float, eye: Eye) -> np.ndarray:
    """Points (m, 2) px on a thing's outline, without errors."""
    local = eye.rotation.T @ (position - eye.position)
    size = np.array(thing.size)
    if thing.kind == "sphere":
        angles = np.linspace(0.0, 2.0 * np.pi, 100, endpoint=False)
        offsets, _ = touching("sphere", size, local, np.eye(3), np.stack([np.cos(angles), np.sin(angles)], axis=1))
        points = local + offsets
    else:
        points = local + surface(thing.kind, size) @ (eye.rotation.T @ upright(yaw)).T
    flat = points[:, :2] / points[:, 2:]
    corners = flat[ConvexHull(flat).vertices]
    sides = np.concatenate([np.linspace(a, b, 1 + int(np.hypot(*(b - a)) * 150), endpoint=False) for a, b in _sides(corners)])
    lens = eye.lens
    found: np.ndarray = lens.distort(sides) * (lens.fx, lens.fy) + (lens.cx, lens.cy)
    return found


def _sides(corners: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    return list(zip(corners, np.roll(corners, -1, axis=0), strict=True))


def seen(thing: Thing, position: np.ndarray, yaw: float, at: Eyes) -> dict[str, Detection]:
    """The exact detections of a thing in both pictures."""
    found = {}
    for name, eye in zip(at.names, at.eyes, strict=True):
        points = outline(thing, position, yaw, eye)
        found[name] = Detection(thing.name, points, float(ConvexHull(points).volume), 1.0)
    return found


def placed(thing: Thing, position: np.ndarray, noise: np.ndarray, bias: np.ndarray, yaw: float = 0.0) -> Placed:
    """A place as two cameras would give it."""
    size = np.array(thing.size)
    return Placed(thing.name, np.asarray(position, float), upright(yaw), size, noise, bias, 0.05 * size, 0.3, 1.0)
