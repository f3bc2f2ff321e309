# SPDX-License-Identifier: Apache-2.0
"""The place, size and orientation of a thing whose outlines are seen by two cameras, by robust least squares, with their covariance."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from mobee.arrays import Array
from mobee.vision.objects.detection import Detection
from mobee.vision.objects.eyes import Eye, Eyes
from mobee.vision.objects.silhouette import SCALED, touching, upright
from mobee.vision.objects.thing import Thing
from mobee.vision.stereo import nearest_to_rays

EDGE = 0.3  # px, standard deviation of a point on an outline; this and the next three were measured in rendered pictures
SHIFT = 0.08  # px, of the whole outline in one picture, along column and row
SHIFT_BOTH = 0.12  # px, of the outlines in both pictures together: the light comes from one side
WIDER = 0.12  # px, of the outline in one picture outwards
DIRECTIONS = 72  # of the lines that touch a silhouette
LOOSE, TIGHT = 6.0, 0.9  # px: a residual of this length has a quarter of its weight, in the first steps and in the last
LOOSE_STEPS, STEPS, ENOUGH = 3, 10, 1e-4  # of Gauss and Newton; m
YAWS = (0.0, 0.25 * np.pi, 0.5 * np.pi, 0.75 * np.pi)  # rad, at which a box is tried first: the others are the same box
LOOSE_INLIER, LEAST_LOOSE = 3.0, 0.5  # px; share of the points that must be nearer after the first steps
INLIER = 1.2  # px
LEAST_INLIERS = 0.85  # share of the points of an outline
HIDDEN = 3.0  # px by which an outline may be shifted beside SHIFT, for each share of its points that is of something in front
SECTORS, LEAST_ARC = 24, 0.6  # of the silhouette; share of them in which there must be inliers
MOST_MISFIT = 0.5  # px, weighted rms of the residuals
NEAREST, FARTHEST = 0.08, 1.0  # m, from a camera
MOST_SIZE = 3.5  # deviations of a length from its usual value


@dataclass(frozen=True, slots=True, eq=False)
class Placed:
    """A thing in the root frame.

    `position` (3,) m, `rotation` (3, 3), `size` (g,) m as of its kind of shape.  The covariance of the position (3, 3) m^2 is the sum of
    `noise`, which is new in each picture, and `bias`, which stays as long as the gaze does.  `size_deviation` (g,) m.  `misfit`: rms of
    the outlines' points from the silhouettes, px.  `share`: of these points that fit.
    """

    name: str
    position: Array
    rotation: Array
    size: Array
    noise: Array
    bias: Array
    size_deviation: Array
    misfit: float
    share: float

    @property
    def covariance(self) -> Array:
        """The covariance (3, 3) m^2 of the position."""
        return self.noise + self.bias


@dataclass(frozen=True, slots=True, eq=False)
class _Outline:
    """An outline in one picture: flat points (m, 2) in the plane at distance 1, and the pixels of a step in it (m, 2, 2), inverted."""

    eye: Eye
    flat: Array
    inverse: Array

    @classmethod
    def of(cls, eye: Eye, outline: Array) -> _Outline | None:
        lens = eye.lens
        flat = lens.undistort((outline - (lens.cx, lens.cy)) / (lens.fx, lens.fy))
        flat = flat[np.isfinite(flat).all(axis=1)]
        if len(flat) < 8:
            return None
        slope = np.array([[lens.fx], [lens.fy]]) * lens.distortion_slope(flat)
        inverse = np.asarray(np.linalg.inv(slope), dtype=np.float64)
        return cls(eye, flat, inverse)


_ANGLES = 2.0 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
_NORMALS = np.stack([np.cos(_ANGLES), np.sin(_ANGLES)], axis=1)


def place(thing: Thing, outlines: Mapping[str, Detection], eyes: Eyes) -> Placed | None:
    """Return the place of a thing from its outlines by camera; None if they do not fit it, or the thing is too near or too far."""
    seen = [_Outline.of(eye, outlines[name].outline) for name, eye in zip(eyes.names, eyes.eyes, strict=True)]
    rays = [eye.rotation @ eye.lens.unproject(outlines[name].centre) for name, eye in zip(eyes.names, eyes.eyes, strict=True)]
    start = nearest_to_rays(np.array([eye.position for eye in eyes.eyes]), np.array(rays))
    if np.isnan(start).any() or any(one is None for one in seen) or not _in_range(eyes, start):
        return None
    every = [one for one in seen if one is not None]
    fits = [_fit(thing, every, eyes, start, yaw) for yaw in (YAWS if thing.kind == "box" else YAWS[:1])]
    good = [fit for fit in fits if fit is not None]
    return min(good, key=lambda fit: fit[0], default=(0.0, None))[1]


def _in_range(eyes: Eyes, position: Array) -> bool:
    offsets = np.array([eye.rotation.T @ (position - eye.position) for eye in eyes.eyes])
    distances = np.linalg.norm(offsets, axis=1)
    return bool((offsets[:, 2] > 0.5 * distances).all() and (distances > NEAREST).all() and (distances < FARTHEST).all())


@dataclass(slots=True, eq=False)
class _Guess:
    """The unknowns: position (3,) m, logarithms of the lengths over the usual ones (g,), yaw [rad], and the errors of the cameras."""

    position: Array
    log_size: Array
    yaw: float
    errors: Array  # (c,), in standard deviations


def _fit(thing: Thing, seen: list[_Outline], eyes: Eyes, start: Array, yaw: float) -> tuple[float, Placed] | None:
    """Return the best fit from a first position and yaw, after its cost; None if it does not explain the outlines."""
    lengths, turns = len(thing.size), int(thing.kind == "box")
    own = 3 + lengths + turns
    count = eyes.noise.shape[1] + eyes.bias.shape[1] + 3 * len(seen) + 2
    guess = _Guess(start, np.zeros(lengths), yaw, np.zeros(count))
    tolerance = max(thing.tolerance, 1e-3)
    prior = np.concatenate([np.zeros(3), np.full(lengths, tolerance**-2), np.zeros(turns), np.ones(count)])
    for step in range(STEPS):
        rows = _rows(thing, seen, eyes, guess)
        if rows is None:
            return None
        residual, slopes, _ = rows
        if step == LOOSE_STEPS and np.mean(np.abs(residual) < LOOSE_INLIER) < LEAST_LOOSE:
            return None
        width = LOOSE if step < LOOSE_STEPS else TIGHT
        weight = (1.0 + (residual / width) ** 2) ** -2 / EDGE**2
        values = np.concatenate([np.zeros(3), guess.log_size, np.zeros(turns), guess.errors])
        normal = (slopes.T * weight) @ slopes + np.diag(prior)
        change = -np.linalg.solve(normal + 1e-9 * np.diag(np.diag(normal)), slopes.T @ (weight * residual) + prior * values)
        change[:3] *= min(1.0, 0.05 / max(float(np.linalg.norm(change[:3])), 1e-12))
        guess.position = guess.position + change[:3]
        guess.log_size = np.clip(guess.log_size + change[3 : 3 + lengths], -0.7, 0.7)
        guess.yaw += float(change[3 + lengths]) if turns else 0.0
        guess.errors = guess.errors + change[own:]
        if step >= LOOSE_STEPS and float(np.abs(change[:3]).max()) < ENOUGH:
            break
    rows = _rows(thing, seen, eyes, guess)
    if rows is None or (np.abs(guess.log_size) > MOST_SIZE * tolerance).any() or not _in_range(eyes, guess.position):
        return None
    return _judged(thing, seen, eyes, guess, rows, prior)


def _judged(
    thing: Thing, seen: list[_Outline], eyes: Eyes, guess: _Guess, rows: tuple[Array, Array, Array], prior: Array
) -> tuple[float, Placed] | None:
    """Return a fit with its covariance, after its cost; None if too few points fit, or they are on a small part of the silhouette."""
    residual, slopes, parts = rows
    lengths, turns = len(thing.size), int(thing.kind == "box")
    own = 3 + lengths + turns
    fits = np.abs(residual) <= INLIER
    hidden = np.zeros(len(seen))
    for number, one in enumerate(seen):
        mine = parts == number
        hidden[number] = 1.0 - fits[mine].mean()
        middle = _projected(one.eye, guess.position)
        away = one.flat - middle
        sector = np.floor(SECTORS * (np.arctan2(away[:, 1], away[:, 0]) + np.pi) / (2.0 * np.pi)).astype(int) % SECTORS
        if hidden[number] > 1.0 - LEAST_INLIERS or len(np.unique(sector[fits[mine]])) < LEAST_ARC * SECTORS:
            return None
    misfit = float(np.sqrt((residual[fits] ** 2).mean()))
    if misfit > MOST_MISFIT:
        return None
    weight = (1.0 + (residual / TIGHT) ** 2) ** -2 / EDGE**2
    inverse = np.linalg.inv((slopes.T * weight) @ slopes + np.diag(prior))
    whole = inverse[:own, :own]
    gain = inverse[:own] @ slopes.T * weight
    moved = gain @ slopes[:, own : own + eyes.noise.shape[1]]
    noise = ((gain / weight) @ gain.T + moved @ moved.T)[:3, :3]
    size = np.array(thing.size) * np.exp(guess.log_size)
    deviation = size * np.sqrt(np.diag(whole)[3 : 3 + lengths])
    shifts = gain[:3] @ slopes[:, -3 * len(seen) - 2 : -2] * (HIDDEN / SHIFT)
    shifted = np.concatenate([hidden[k] * shifts[:, 3 * k : 3 * k + 2] for k in range(len(seen))], axis=1)
    bias = _positive(whole[:3, :3] - noise) + shifted @ shifted.T
    unlikely = float(prior[3 : 3 + lengths] @ guess.log_size**2 + guess.errors @ guess.errors)
    cost = float((weight * residual**2 * (1.0 + (residual / TIGHT) ** 2)).sum()) + unlikely
    placed = Placed(thing.name, guess.position, upright(guess.yaw), size, noise, bias, deviation, misfit, float(fits.mean()))
    return cost, placed


def _positive(matrix: Array) -> Array:
    """Return the symmetric matrix without negative eigenvalues, which rounding may leave."""
    values, vectors = np.linalg.eigh(0.5 * (matrix + matrix.T))
    found: Array = (vectors * np.maximum(values, 0.0)) @ vectors.T
    return found


def _projected(eye: Eye, position: Array) -> Array:
    local = eye.rotation.T @ (position - eye.position)
    flat: Array = local[:2] / local[2]
    return flat


def _rows(thing: Thing, seen: list[_Outline], eyes: Eyes, guess: _Guess) -> tuple[Array, Array, Array] | None:
    """Return the residuals (m,) px of all points, positive outside the silhouette, their slopes (m, p), and whose they are (m,).

    None if the thing is not wholly ahead of a camera.
    """
    size, turn = np.array(thing.size) * np.exp(guess.log_size), upright(guess.yaw)
    residuals, slopes, parts = [], [], []
    for number, one in enumerate(seen):
        local = one.eye.rotation.T @ (guess.position - one.eye.position)
        if local[2] <= 1.2 * float(np.linalg.norm(size)):
            return None
        offsets, farthest = touching(thing.kind, size, local, one.eye.rotation.T @ turn, _NORMALS)
        distance = one.flat @ _NORMALS.T - farthest
        nearest = distance.argmax(axis=1)
        normal, along, offset = _NORMALS[nearest], farthest[nearest], offsets[nearest]
        gradient = np.einsum("mij,mi->mj", one.inverse, normal)
        scale = np.linalg.norm(gradient, axis=1)  # of a pixel in the plane at distance 1
        residual = distance[np.arange(len(nearest)), nearest] / scale
        ahead = local[2] + offset[:, 2]
        by_point = -np.column_stack([normal, -along]) / (ahead * scale)[:, None] @ one.eye.rotation.T  # of the root frame
        offset = offset @ one.eye.rotation.T
        columns = [by_point]
        inside = offset @ turn
        by_inside = by_point @ turn
        columns += [(by_inside[:, axes] * inside[:, axes]).sum(axis=1)[:, None] for axes in map(list, SCALED[thing.kind])]
        if thing.kind == "box":
            columns.append((by_point[:, 1] * offset[:, 0] - by_point[:, 0] * offset[:, 1])[:, None])
        away = guess.position + offset - one.eye.position
        by_camera = -np.column_stack([by_point, np.cross(away, by_point)])
        mine = slice(6 * number, 6 * number + 6)
        columns += [by_camera @ eyes.noise[mine], by_camera @ eyes.bias[mine]]
        unit = gradient / scale[:, None]
        shift = np.zeros((len(unit), 3 * len(seen)))
        shift[:, 3 * number : 3 * number + 2], shift[:, 3 * number + 2] = SHIFT * unit, WIDER
        columns += [shift, SHIFT_BOTH * unit]
        residuals.append(residual)
        slopes.append(np.concatenate(columns, axis=1))
        parts.append(np.full(len(residual), number))
    slope = np.concatenate(slopes)
    return np.concatenate(residuals) + slope[:, -len(guess.errors) :] @ guess.errors, slope, np.concatenate(parts)
