# SPDX-License-Identifier: Apache-2.0
"""Computes the positions, sizes and orientations of the things that two cameras see, with covariance, from outlines in their pictures.

`locate_all` finds the detections that belong to the same thing; `place` computes where one thing is, by robust least squares. `Eyes` has
the positions of the cameras at the stamp of a picture, and their uncertainty, for all cameras together.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mobee._core.vision import Silhouette
from mobee.arrays import Array
from mobee.model.kinematics import link_transforms, point_jacobian
from mobee.model.world_object import WorldObject
from mobee.vision.encoders import Moment
from mobee.vision.lens import Lens, camera_frames, right_slope, rotation_of
from mobee.vision.objects.detection import Detection
from mobee.vision.objects.thing import SCALED, Thing, surface, touching, upright
from mobee.vision.rig import Rig
from mobee.vision.stereo import nearest_to_rays

NEGLIGIBLE = 1e-12  # share of the largest variance below which a direction is left out
EDGE = 0.3  # px, standard deviation of a point on an outline; this and the next three were measured in rendered pictures
SHIFT = 0.08  # px, of the whole outline in one picture, along column and row
SHIFT_BOTH = 0.12  # px, of the outlines in both pictures together: the light comes from one side
WIDER = 0.12  # px, of the outline in one picture outwards
FEWEST = 8  # points of an outline
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
_ANGLES = 2.0 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
_NORMALS = np.stack([np.cos(_ANGLES), np.sin(_ANGLES)], axis=1)
GAP = 0.03  # m between the rays through the middles of two outlines
LIKELY_SIZE = (0.5, 2.0)  # of the usual diameter: what two outlines may have by their areas
SUNK = 0.012  # m by which a thing may reach into a known solid, beside three standard deviations
APART = 0.5  # of the sum of two things' half diameters: nearer things are the same one, seen twice


@dataclass(frozen=True, slots=True, eq=False)
class Eye:
    """A camera in the root frame.

    `position`: (3,) m, of the optical centre. `rotation`: (3, 3) with the columns right, down, ahead. `lens`: lens of the camera.
    """

    position: Array
    rotation: Array
    lens: Lens


@dataclass(frozen=True, slots=True, eq=False)
class Eyes:
    """The E cameras of a robot at one stamp (time of a picture), with the uncertainty of their poses.

    `names`: the cameras; `eyes` and the rows below have the same order. An uncertainty is a factor F (6 E, r): F F' is the covariance of
    the pose errors of all cameras together. F has six rows for each camera: the displacement of its optical centre along x, y and z of the
    root frame [m], then its rotation about the directions x, y and z of the root frame, through the optical centre [rad]. There are two
    such factors, each with its own r. `noise`: for the errors that are new in each picture (of encoders and stamp). `bias`: for the errors
    that stay the same while the gaze does not change (of the calibration).
    """

    names: tuple[str, ...]
    eyes: tuple[Eye, ...]
    noise: Array
    bias: Array


def eyes_at(rig: Rig, x: Array, moment: Moment, uncertainty: Array | None = None, jitter: float = 0.0) -> Eyes:
    """Return the cameras of a rig, with their uncertainty, at the stamp (time) of a picture.

    Args:
        rig: the robot and its cameras.
        x: the calibration's parameters (P,).
        moment: encoder values at the stamp, with velocities and variances.
        uncertainty: covariance (P, P) of the parameters; None: they are exact.
        jitter: standard deviation of the error of the stamp, s.
    """
    transforms = link_transforms(rig.robot, rig.posture(x, moment.q, moment.dq))
    eyes, motions, slopes = [], [], []
    for name, camera in rig.cameras.items():
        mount = x[rig.where(name)]
        position, rotation = camera_frames(camera, transforms, mount)
        by_posture = point_jacobian(rig.robot, transforms, camera.link, position)
        by_parameters = np.zeros((6, len(x)))
        first = rig.where(name).start
        by_parameters[:3, first : first + 3] = rotation @ rotation_of(mount[3:]).T
        by_parameters[3:, first + 3 : first + 6] = rotation @ right_slope(mount[3:])
        by_parameters[:, rig.where("encoder")] = by_posture[:, list(rig.head)]
        by_parameters[:, rig.where("latency")] = -(by_posture @ moment.dq)[:, None]
        eyes.append(Eye(position, rotation, rig.lens))
        motions.append(by_posture)
        slopes.append(by_parameters)
    motion, slope = np.concatenate(motions), np.concatenate(slopes)
    late = jitter * (motion @ moment.dq)
    noise = _factor((motion * moment.variance) @ motion.T + np.outer(late, late))
    bias = np.zeros((len(slope), 0)) if uncertainty is None else _factor(slope @ uncertainty @ slope.T)
    return Eyes(tuple(rig.cameras), tuple(eyes), noise, bias)


def _factor(covariance: Array) -> Array:
    """Return F (n, r) with F F' = covariance."""
    scale = np.sqrt(np.maximum(np.diag(covariance), 1e-30))  # displacements and turns have different units
    values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    kept = values > NEGLIGIBLE * max(values.max(), 1e-30)
    factor: Array = scale[:, None] * vectors[:, kept] * np.sqrt(values[kept])
    return factor


@dataclass(frozen=True, slots=True, eq=False)
class Placed:
    """A thing that was located, in the root frame.

    Attributes:
        name: name of the thing.
        position: (3,) m.
        rotation: (3, 3), of the shape's axes.
        size: (g,) m, the lengths of its shape, in the order of `Thing.size`.
        noise: (3, 3) m^2, covariance of the position from errors that are new in each picture.
        bias: (3, 3) m^2, covariance of the position from errors that stay the same while the gaze does not change.
        size_deviation: (g,) m, standard deviations of the size.
        misfit: px, rms distance of the outlines from the predicted edge of the shape (silhouette), over the points that fit.
        share: share of the points of the outlines that fit, 0 to 1; a point fits if it is at most 1.2 px from the silhouette.
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
        """The whole covariance of the position (3, 3) m^2: `noise` plus `bias`."""
        return self.noise + self.bias


@dataclass(frozen=True, slots=True, eq=False)
class Outline:
    """An outline in one picture, without the distortion of the lens.

    `eye`: the camera. `flat`: (m, 2), points (x / z, y / z) of the outline in the camera's frame. `inverse`: (m, 2, 2) [1/px], derivatives
    of these points with respect to column and row. `ray`: (3,) unit vector through the middle of the outline, root frame.
    """

    eye: Eye
    flat: Array
    inverse: Array
    ray: Array

    @classmethod
    def all_of(cls, eye: Eye, detections: Sequence[Detection]) -> list[Outline]:
        """Return the outline of each detection in a picture of the camera `eye`; points that have no ray in the lens are left out."""
        if not detections:
            return []
        lens = eye.lens
        every = np.concatenate([*(one.outline for one in detections), [one.centre for one in detections]])
        flat = lens.undistort((every - (lens.cx, lens.cy)) / (lens.fx, lens.fy))
        slope = np.array([[lens.fx], [lens.fy]]) * lens.distortion_slope(flat)
        shown = np.asarray(np.isfinite(flat).all(axis=1))
        inverse = np.full(slope.shape, np.nan)
        inverse[shown] = np.linalg.inv(slope[shown])
        rays = np.concatenate([flat[len(flat) - len(detections) :], np.ones((len(detections), 1))], axis=1) @ eye.rotation.T
        rays /= np.linalg.norm(rays, axis=1, keepdims=True)
        found, first = [], 0
        for one, ray in zip(detections, rays, strict=True):
            mine = np.flatnonzero(shown[first : first + len(one.outline)]) + first
            found.append(cls(eye, flat[mine], inverse[mine], ray))
            first += len(one.outline)
        return found


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
    """The D detections in one picture, as rays from the camera.

    `names`: of the things (D,). `origin`: optical centre (3,) m. `rays`: unit vectors (D, 3) through the middles of the detections, root
    frame. `angles`: (D,) rad, the angle that each detection subtends, if it is a disc of the same area.
    """

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
    """Return the pairs (a, b) of detections, in the left and the right picture, that may show the same object of the kind `thing`.

    a and b are indices in `left` and `right`. Both detections have the thing's name, and their rays pass each other at less than GAP. At
    this place, in the range of the cameras, the area of each detection must mean a diameter between half and twice the usual one.
    """
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


def place(thing: Thing, outlines: Sequence[Outline], eyes: Eyes) -> Placed | None:
    """Return position, rotation and size of a thing from its outlines; None if they do not fit the thing, or it is too near or too far.

    `outlines`: one for each camera, in the order of the cameras of `eyes`.
    """
    start = nearest_to_rays(np.array([eye.position for eye in eyes.eyes]), np.array([one.ray for one in outlines]))
    if np.isnan(start).any() or min(len(one.flat) for one in outlines) < FEWEST or not _in_range(eyes, start):
        return None
    fits = [_fit(thing, outlines, eyes, start, yaw) for yaw in (YAWS if thing.kind == "box" else YAWS[:1])]
    good = [fit for fit in fits if fit is not None]
    return min(good, key=lambda fit: fit[0], default=(0.0, None))[1]


def _in_range(eyes: Eyes, position: Array) -> bool:
    offsets = np.array([eye.rotation.T @ (position - eye.position) for eye in eyes.eyes])
    distances = np.linalg.norm(offsets, axis=1)
    return bool((offsets[:, 2] > 0.5 * distances).all() and (distances > NEAREST).all() and (distances < FARTHEST).all())


@dataclass(slots=True, eq=False)
class _Guess:
    """The unknowns that the fit of a thing to its outlines estimates.

    `position`: (3,) m. `log_size`: (g,), logarithms of length / usual length, for each length of the shape. `yaw`: rad. `errors`: (c,),
    errors of the camera poses and of the outlines, each divided by its standard deviation.
    """

    position: Array
    log_size: Array
    yaw: float
    errors: Array  # (c,), in standard deviations


def _fit(thing: Thing, seen: Sequence[Outline], eyes: Eyes, start: Array, yaw: float) -> tuple[float, Placed] | None:
    """Return the best fit from a first position and yaw, after its cost; None if it does not explain the outlines."""
    lengths, turns = len(thing.size), int(thing.kind == "box")
    own = 3 + lengths + turns
    count = eyes.noise.shape[1] + eyes.bias.shape[1] + 3 * len(seen) + 2
    guess = _Guess(start, np.zeros(lengths), yaw, np.zeros(count))
    tolerance = max(thing.tolerance, 1e-3)
    prior = np.concatenate([np.zeros(3), np.full(lengths, tolerance**-2), np.zeros(turns), np.ones(count)])
    compared = [_compared(thing, one, eyes, number) for number, one in enumerate(seen)]
    for step in range(STEPS):
        rows = _rows(thing, seen, compared, guess)
        if rows is None:
            return None
        residual, slopes, _ = rows
        if step == LOOSE_STEPS and np.mean(np.abs(residual) < LOOSE_INLIER) < LEAST_LOOSE:
            return None
        width = LOOSE if step < LOOSE_STEPS else TIGHT
        weight = (1.0 + (residual / width) ** 2) ** -2 / EDGE**2
        values = np.concatenate([np.zeros(3), guess.log_size, np.zeros(turns), guess.errors])
        normal = (slopes.T * weight) @ slopes
        normal.flat[:: len(prior) + 1] += prior
        normal.flat[:: len(prior) + 1] *= 1.0 + 1e-9
        change = -np.linalg.solve(normal, slopes.T @ (weight * residual) + prior * values)
        change[:3] *= min(1.0, 0.05 / max(float(np.linalg.norm(change[:3])), 1e-12))
        guess.position = guess.position + change[:3]
        guess.log_size = np.clip(guess.log_size + change[3 : 3 + lengths], -0.7, 0.7)
        guess.yaw += float(change[3 + lengths]) if turns else 0.0
        guess.errors = guess.errors + change[own:]
        if step >= LOOSE_STEPS and float(np.abs(change[:3]).max()) < ENOUGH:
            break
    rows = _rows(thing, seen, compared, guess)
    if rows is None or (np.abs(guess.log_size) > MOST_SIZE * tolerance).any() or not _in_range(eyes, guess.position):
        return None
    return _judged(thing, seen, eyes, guess, rows, prior)


def _judged(
    thing: Thing, seen: Sequence[Outline], eyes: Eyes, guess: _Guess, rows: tuple[Array, Array, Array], prior: Array
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


def _compared(thing: Thing, one: Outline, eyes: Eyes, number: int) -> Silhouette:
    """Return a Silhouette that compares one outline with the computed silhouettes of the thing; `number`: index of its camera in `eyes`."""
    mine, length_of = slice(6 * number, 6 * number + 6), [0, 0, 0]
    for length, axes in enumerate(SCALED[thing.kind]):
        for axis in axes:
            length_of[axis] = length
    camera = one.eye.position, one.eye.rotation, eyes.noise[mine], eyes.bias[mine]
    shifts = SHIFT, WIDER, SHIFT_BOTH
    return Silhouette(camera, (number, len(eyes.eyes)), one.flat, one.inverse, _NORMALS, length_of, thing.kind == "box", shifts)


def _rows(thing: Thing, seen: Sequence[Outline], compared: list[Silhouette], guess: _Guess) -> tuple[Array, Array, Array] | None:
    """Return the residuals (m,) px of the points of all outlines, their derivatives (m, p), and the index of each point's outline (m,).

    A residual is the distance of a point from the silhouette computed for `guess`, positive outside. The p unknowns are position, log
    lengths, yaw (of a box only) and errors, in this order. None if the thing is not wholly ahead of a camera.
    """
    size, turn = np.array(thing.size) * np.exp(guess.log_size), upright(guess.yaw)
    rows = []
    for one, silhouette in zip(seen, compared, strict=True):
        local = one.eye.rotation.T @ (guess.position - one.eye.position)
        if local[2] <= 1.2 * float(np.linalg.norm(size)):
            return None
        touched = touching(thing.kind, size, local, one.eye.rotation.T @ turn, _NORMALS)
        rows.append(silhouette.rows(guess.position, turn, touched, guess.errors))
    residuals, slopes = zip(*rows, strict=True)
    return np.concatenate(residuals), np.concatenate(slopes), np.repeat(np.arange(len(rows)), [len(one) for one in residuals])
