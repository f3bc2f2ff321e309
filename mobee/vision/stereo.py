# SPDX-License-Identifier: Apache-2.0
"""The position of a point that two or more cameras see, with a covariance from the noise of pixels, encoders, time and calibration."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from mobee.arrays import Array
from mobee.model.kinematics import link_transforms
from mobee.vision.encoders import Moment
from mobee.vision.lens import camera_frames
from mobee.vision.rig import Rig, see_points

STEPS, ENOUGH = 8, 1e-7  # of Gauss and Newton, m
PARALLEL = 1e6  # condition above which rays count as parallel


@dataclass(frozen=True, slots=True, eq=False)
class Sighted:
    """A point in one picture.

    `pixel`: (2,) px, column and row. `noise`: standard deviation of each of the two, px.
    """

    pixel: Array
    noise: float


@dataclass(frozen=True, slots=True, eq=False)
class Place:
    """A located point in the root frame.

    `position`: (3,) m. `covariance`: (3, 3) m^2. `misfit`: squared Mahalanobis length of the residuals of all its pixels, no unit.
    """

    position: Array
    covariance: Array
    misfit: float


def nearest_to_rays(origins: Array, rays: Array) -> Array:
    """Return the points (..., 3) m that are nearest to E rays each, by least squares.

    `origins`: (..., E, 3) m. `rays`: (..., E, 3) unit vectors. NaN where all rays are parallel, or where a ray is NaN.
    """
    across = np.eye(3) - rays[..., :, None] * rays[..., None, :]
    normal, against = across.sum(axis=-3), np.einsum("...eij,...ej->...i", across, origins)
    fits = np.isfinite(normal).all(axis=(-2, -1))
    fits &= np.linalg.cond(np.where(fits[..., None, None], normal, 0.0)) < PARALLEL
    solved = np.linalg.solve(np.where(fits[..., None, None], normal, np.eye(3)), against[..., None])[..., 0]
    found: Array = np.where(fits[..., None], solved, np.nan)
    return found


def rays_meet(rig: Rig, x: Array, moment: Moment, sighted: Mapping[str, Sighted]) -> Array | None:
    """Return the position (3,) m, root frame, that is nearest to the rays through given pixels of several cameras.

    None if the rays are parallel, or if a pixel has no ray (the lens model maps no direction to it). `x`: (P,) the calibration's
    parameters. `moment`: encoder values at the time of the pictures. `sighted`: the point in the pictures, by name of the camera.
    """
    transforms = link_transforms(rig.robot, rig.posture(x, moment.q, moment.dq))
    frames = {name: camera_frames(rig.cameras[name], transforms, x[rig.where(name)]) for name in sighted}
    rays = [rotation @ rig.lens.unproject(sighted[name].pixel) for name, (_, rotation) in frames.items()]
    found = nearest_to_rays(np.array([position for position, _ in frames.values()]), np.array(rays))
    return None if np.isnan(found).any() else found


def locate(
    rig: Rig,
    x: Array,
    moment: Moment,
    sighted: Mapping[str, Sighted],
    uncertainty: Array | None = None,
    jitter: float = 0.0,
) -> Place | None:
    """Return the position (root frame) of a point from its pixels in two or more pictures with the same time stamp, by least squares.

    None if the rays through the pixels are parallel, if a pixel has no ray (the lens model maps no direction to it), or if the iteration
    reaches a point behind a camera.

    Args:
        rig: the robot and its cameras.
        x: the calibration's parameters (P,).
        moment: encoder values at the time stamp.
        sighted: the point in the pictures, by name of the camera.
        uncertainty: covariance (P, P) of the parameters; None: they are exact.
        jitter: standard deviation of the time stamp, s.
    """
    place = rays_meet(rig, x, moment, sighted)
    if place is None:
        return None
    measured = np.concatenate([one.pixel for one in sighted.values()])
    own = np.repeat([one.noise**2 for one in sighted.values()], 2)
    q, dq = moment.q[None], moment.dq[None]
    for _ in range(STEPS):
        seen = [see_points(rig, camera, x, q, dq, place[None, None]) for camera in sighted]
        slope = np.concatenate([one.by_point[0, 0] for one in seen])
        by_posture = np.concatenate([one.by_posture[0, 0] for one in seen])
        late = np.concatenate([one.by_time[0, 0] for one in seen])
        spread = np.diag(own) + (by_posture * moment.variance) @ by_posture.T + jitter**2 * np.outer(late, late)
        if uncertainty is not None:
            by_parameters = np.concatenate([one.by_parameters[0, 0] for one in seen])
            spread = spread + by_parameters @ uncertainty @ by_parameters.T
        missing = measured - np.concatenate([one.pixels[0, 0] for one in seen])
        if not np.isfinite(missing).all():
            return None
        weighted = np.linalg.solve(spread, slope)
        covariance = np.linalg.inv(slope.T @ weighted)
        step = covariance @ (weighted.T @ missing)
        place = place + step
        if float(np.abs(step).max()) < ENOUGH:
            break
    left = missing - slope @ step
    return Place(place, covariance, float(left @ np.linalg.solve(spread, left)))
