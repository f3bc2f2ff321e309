# SPDX-License-Identifier: Apache-2.0
"""Estimates the errors of a robot's cameras from observations of its own hand: nonlinear least squares with a robust loss."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from mobee.arrays import Array, Ints
from mobee.errors import InvalidValue
from mobee.model.kinematics import link_transforms
from mobee.vision.calibration.calibration import Calibration, Observation, Quality, Unobservable, stacked
from mobee.vision.imperfections import CameraSettings
from mobee.vision.lens import mounted
from mobee.vision.rig import Rig, see_tag
from mobee.vision.stereo import Sighted, locate
from mobee.vision.tag import Tag

CORNER_NOISE = (
    0.25  # px: standard deviation of a corner along column and row, 3 times the measured one: similar pictures have similar errors
)
ROBUST = 3.0  # standard deviations beyond which a residual counts less (soft L1)
ROUNDS = 3  # of weighting: the weights depend on the derivatives, which depend on the parameters
FEWEST = 8  # pictures
NULL = 0.05  # share of the prior variance by which the pictures must at least reduce it, or a direction counts as not observable
NAMED = 0.25  # weight in a direction above which a parameter is named


@dataclass(frozen=True, slots=True, eq=False)
class _Problem:
    """The observations of a calibration, stacked: N moments at which the cameras took pictures of the tag.

    A row is a coordinate of a corner in px: 8 rows for each camera; they are 0 where the camera did not see the tag. `q`: encoder values
    (N, n) rad. `dq`: their velocities (N, n) rad/s. `variance`: their variances (N, n) rad^2. `corners`: (N, cameras, 4, 2) px, NaN where
    the tag was not seen.
    """

    rig: Rig
    tag: Tag
    q: Array  # (N, n)
    dq: Array  # (N, n)
    variance: Array  # (N, n)
    corners: Array  # (N, cameras, 4, 2), NaN where the tag was not seen

    @classmethod
    def of(cls, rig: Rig, observations: Sequence[Observation]) -> _Problem:
        if rig.tag is None:
            raise InvalidValue("the rig has no tag: name the marker that carries it, as Rig(..., tag=Tag('left_palm'))")
        corners = np.full((len(observations), len(rig.cameras), 4, 2), np.nan)
        for number, one in enumerate(observations):
            for place, camera in enumerate(rig.cameras):
                if camera in one.corners:
                    corners[number, place] = one.corners[camera]
        return cls(rig, rig.tag, *stacked(observations), corners)

    @property
    def seen(self) -> Array:
        """Whether each row (N, rows) is of a picture that shows the tag."""
        found: Array = np.isfinite(self.corners).reshape(len(self.q), -1)
        return found

    def linear(self, x: Array) -> tuple[Array, Array, Array]:
        """Return residuals (N, rows) px, their derivatives by the parameters (N, rows, P), and two covariance matrices, (N, 2, rows, rows).

        The first covariance is that by the noise of the encoders, px^2. The second is that by a standard deviation of 1 s of the stamp (the
        time of the picture), px^2 per s^2; the caller multiplies it by the variance of the stamps.
        """
        count, cameras = self.corners.shape[:2]
        residuals = np.zeros((count, cameras, 8))
        by_parameters = np.zeros((count, cameras, 8, len(x)))
        by_posture = np.zeros((count, cameras, 8, self.q.shape[1]))
        by_time = np.zeros((count, cameras, 8))
        for place, camera in enumerate(self.rig.cameras):
            which: Ints = np.flatnonzero(np.isfinite(self.corners[:, place, 0, 0]))
            if not len(which):
                continue
            seen = see_tag(self.rig, camera, x, self.q[which], self.dq[which])
            residuals[which, place] = (seen.pixels - self.corners[which, place]).reshape(-1, 8)
            by_parameters[which, place] = seen.by_parameters.reshape(len(which), 8, -1)
            by_posture[which, place] = seen.by_posture.reshape(len(which), 8, -1)
            by_time[which, place] = seen.by_time.reshape(-1, 8)
        rows = 8 * cameras
        moved, late = by_posture.reshape(count, rows, -1), by_time.reshape(count, rows)
        spread = np.einsum("krn,kn,ksn->krs", moved, self.variance, moved)
        lagging = late[:, :, None] * late[:, None]
        return residuals.reshape(count, rows), by_parameters.reshape(count, rows, -1), np.stack([spread, lagging], axis=1)


def calibrate(rig: Rig, observations: Sequence[Observation], settings: CameraSettings, corner_noise: float = CORNER_NOISE) -> Calibration:
    """Estimate the errors of the mounts (poses of cameras and tag on their links), the head's encoders, and the latency of pictures.

    The residuals of a picture are weighted by their covariance: noise of the corners, and noise of the encoders and of the stamp (the time
    of the picture), which moves all corners of a picture together.  The prior follows from the tolerances in `settings`; where a tolerance
    is 0, the error is 0.  Loss: soft L1.

    Args:
        rig: the robot, its cameras at the positions of the model, and the tag.
        observations: pictures of the tag, with the encoders at their stamps.
        settings: the tolerances of the errors, and the jitter of the stamps.
        corner_noise: standard deviation of a measured corner along column and row, px.

    Raises:
        InvalidValue: fewer than 8 pictures show the tag, the rig has no tag, or the noise is not above 0.
    """
    if not 0.0 < corner_noise < np.inf:
        raise InvalidValue(f"corner_noise {corner_noise} px: must be a finite number above 0")
    problem, scale = _Problem.of(rig, observations), rig.deviations(settings.deviations)
    pictures = int(problem.seen.any(axis=1).sum())
    if pictures < FEWEST:
        raise InvalidValue(f"{pictures} pictures show the tag: at least {FEWEST} are needed. Use more postures, or a larger tag.")
    solve = _Solver(problem, scale, corner_noise, settings.jitter)
    x: Array = np.zeros(len(scale))
    for _ in range(ROUNDS):
        x, scaled = solve(x)
    information = scaled.T @ scaled
    inverse = np.linalg.inv(information)
    residuals, derivatives, _ = problem.linear(x)
    whitened, slopes = solve.whitened(residuals, derivatives)
    misfit = float((whitened[problem.seen] ** 2).mean())
    covariance = scale[:, None] * (max(1.0, misfit) * inverse) * scale
    before, after = (_quality(rig, problem, observations, one) for one in (np.zeros(len(x)), x))
    hidden = _unobservable(rig, slopes.reshape(-1, len(x)) * scale, np.flatnonzero(scale))
    return Calibration(
        robot=rig.robot.name,
        cameras=tuple(rig.cameras),
        lens=rig.lens,
        tag=problem.tag,
        pictures=pictures,
        names=rig.names,
        x=x,
        covariance=covariance,
        prior=scale,
        misfit=misfit,
        uncalibrated=before,
        calibrated=after,
        unobservable=hidden,
    )


class _Solver:
    """The least-squares problem of the calibration, in scaled parameters.

    Each parameter is divided by its standard deviation before the measurement (prior), so that this deviation becomes 1.
    """

    def __init__(self, problem: _Problem, scale: Array, noise: float, jitter: float) -> None:
        self._problem, self._scale, self._noise, self._jitter = problem, scale, noise, jitter
        self._roots: Array = np.empty(0)

    def __call__(self, start: Array) -> tuple[Array, Array]:
        """Return the parameters (P,) that minimise the weighted errors, and the Jacobian (rows, P) there.

        The weights are computed from the errors' covariances at `start` (P,). The Jacobian is by the parameters in units of their prior
        deviation. Its rows include the weights of the robust loss; the last P rows are those of the prior.
        """
        self._weigh(start)
        newest: list[tuple[Array, Array, Array]] = []

        def at(y: Array) -> tuple[Array, Array]:
            if not newest or (newest[0][0] != y).any():
                residuals, derivatives, _ = self._problem.linear(self._scale * y)
                whitened, slopes = self.whitened(residuals, derivatives)
                flat = slopes.reshape(-1, len(y)) * self._scale
                newest[:] = [(y.copy(), np.concatenate([whitened.ravel(), y]), np.concatenate([flat, np.eye(len(y))]))]
            return newest[0][1:]

        function: Callable[[Array], Array] = lambda y: at(y)[0]  # noqa: E731
        scaled = start / np.where(self._scale > 0.0, self._scale, 1.0)
        found = least_squares(function, scaled, jac=lambda y: at(y)[1], loss="soft_l1", f_scale=ROBUST, method="trf")
        return self._scale * found.x, np.asarray(found.jac)

    def whitened(self, residuals: Array, derivatives: Array) -> tuple[Array, Array]:
        """Return residuals (N, rows) and derivatives (N, rows, P) whose measured part has the covariance 1."""
        both = np.linalg.solve(self._roots, np.concatenate([residuals[..., None], derivatives], axis=-1))
        return both[..., 0], both[..., 1:]

    def _weigh(self, x: Array) -> None:
        _, _, spreads = self._problem.linear(x)
        size = spreads.shape[-1]
        own = np.where(self._problem.seen, self._noise**2, 1.0)
        total: Array = spreads[:, 0] + self._jitter**2 * spreads[:, 1] + own[:, :, None] * np.eye(size)
        self._roots = np.asarray(np.linalg.cholesky(total), dtype=np.float64)


def _unobservable(rig: Rig, slopes: Array, unknown: Ints) -> tuple[Unobservable, ...]:
    """Return the directions of the parameters about which the pictures say almost nothing, from slopes (rows, P) in prior deviations.

    A direction of unit length with singular value s is known to 1 / sqrt(1 + s^2) of its prior deviation. `unknown`: indices of the
    parameters whose prior deviation is not 0.
    """
    _, values, directions = np.linalg.svd(slopes[:, unknown], full_matrices=False)
    found = []
    for value, direction in zip(values, directions, strict=True):
        if value**2 / (1.0 + value**2) < NULL:
            order = np.argsort(-np.abs(direction))
            large = [k for k in order if abs(direction[k]) >= NAMED * abs(direction[order[0]])]
            named = {rig.names[unknown[k]]: round(float(direction[k]), 3) for k in large}
            found.append(Unobservable(float(value), named))
    return tuple(found)


def _quality(rig: Rig, problem: _Problem, observations: Sequence[Observation], x: Array) -> Quality:
    """Return how far corners are from where the parameters put them in the pictures, and the tag's centre in space."""
    residuals, _, _ = problem.linear(x)
    lengths = np.linalg.norm(residuals.reshape(len(problem.q), -1, 2), axis=-1)
    pixels: Array = lengths[problem.seen.reshape(len(problem.q), -1, 2).all(axis=-1)]
    gaps = []
    for one in observations:
        if len(one.corners) == len(rig.cameras) and len(rig.cameras) > 1:
            middles = {camera: Sighted(corners.mean(axis=0), 0.5) for camera, corners in one.corners.items()}
            place = locate(rig, x, one.moment, middles)
            if place is not None:
                gaps.append(float(np.linalg.norm(place.position - tag_centre(rig, x, one))))
    return Quality.of(pixels, np.array(gaps))


def tag_centre(rig: Rig, x: Array, one: Observation) -> Array:
    """Return the position (3,) m, root frame, of the middle of the hand's tag according to the encoders of an observation.

    The tag is an AprilTag on the palm. `x`: (P,) the calibration's parameters.
    """
    assert rig.tag is not None
    link, position, rotation = rig.tag.frame(rig.robot)
    centre, _ = mounted(position, rotation, x[rig.where("tag")])
    hand = link_transforms(rig.robot, rig.posture(x, one.moment.q, one.moment.dq))[link]
    found: Array = hand[:3, :3] @ centre + hand[:3, 3]
    return found
