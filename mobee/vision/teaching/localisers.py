# SPDX-License-Identifier: Apache-2.0
"""Localisers, which learn the position of a thing from its pixels in two pictures and the encoders (thesis 4.1.2; Leitner et al. 2012).

The inputs (N, 13) are those of `mobee.vision.teaching.lessons`: column and row of the thing in the left picture, then in the right one
[px], then the encoders of torso and head [rad], the last three of which are the eyes' tilt, version and vergence, as on the iCub.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from mobee.arrays import Array
from mobee.errors import NotInstalled, UnknownName
from mobee.model.kinematics import link_transforms
from mobee.vision.imperfections import CameraSettings
from mobee.vision.lens import Lens, camera_frames
from mobee.vision.rig import Rig
from mobee.vision.stereo import nearest_to_rays
from mobee.vision.teaching.cartesian_programs import CartesianPrograms
from mobee.vision.teaching.lessons import seeing_motors

DEGREE, PENALTIES = 2, np.logspace(-4.0, 3.0, 15)  # of the polynomial; of its coefficients, of which cross-validation chooses one
HIDDEN, DECAY, STEPS = 20, 3e-3, 3000  # units; penalty of the weights; of L-BFGS
LENGTH, LENGTHS, NOISE = 8.0, (0.1, 1e4), (1e-7, 1.0)  # of the Gaussian process: start and bounds, in deviations of the inputs
SPREAD, FAR, ROUNDS = 0.01, 100.0, 12  # of corrected stereo: m, deviation of a place; its largest residual in these; steps
FEATURES = 16  # of `eye_features`
NEAREST = 0.08  # rad: the smallest angle between the rays of both eyes, of a thing 0.85 m away, out of reach


class Localiser(Protocol):
    """The interface of a localiser, which learns positions of a thing (a visible object) from pixels and encoders.

    An input has 13 numbers: column and row of the thing in the left picture, then in the right one [px], then the encoders of torso and
    head [rad].
    """

    def fit(self, inputs: Array, places: Array) -> None:
        """Learn from inputs (N, 13) and positions `places` (N, 3) m, root frame; everything learned before is discarded."""

    def predict(self, inputs: Array) -> Array:
        """Return the predicted positions (M, 3) m, root frame, for inputs (M, 13)."""


def eye_features(inputs: Array, lens: Lens) -> Array:
    """Return the inputs (N, 13) with three more columns, (N, 16): the approximate position of the thing relative to the head.

    The unit of this position is about the distance between the eyes. The position follows from the angles of the eyes: the direction to the
    thing is about the angle of the eye plus the angle of the thing in the picture, and the distance is about the inverse of the angle
    between the rays of both eyes. The kinematic model is not used.
    """
    flat = (inputs[:, :4].reshape(-1, 2, 2) - (lens.cx, lens.cy)) / (lens.fx, lens.fy)
    tilt, version, vergence = inputs[:, -3:].T
    aside, down = np.arctan(flat[..., 0]), np.arctan(flat[..., 1].mean(axis=1)) - tilt
    left, right = aside[:, 0] + version + 0.5 * vergence, aside[:, 1] + version - 0.5 * vergence
    far, middle = 1.0 / np.maximum(left - right, NEAREST), 0.5 * (left + right)
    place = far[:, None] * np.stack([np.cos(down) * np.cos(middle), np.cos(down) * np.sin(middle), np.sin(down)], axis=1)
    return np.concatenate([inputs, place], axis=1)


@dataclass(frozen=True, slots=True, eq=False)
class Scale:
    """Mean and standard deviation (d,) of the columns of a table, for standardising."""

    mean: Array
    deviation: Array

    @classmethod
    def of(cls, rows: Array) -> Scale:
        """Return the mean and the standard deviation of each column of `rows` (N, d); the deviation of a constant column is set to 1."""
        deviation = rows.std(axis=0)
        return cls(rows.mean(axis=0), np.where(deviation > 0.0, deviation, 1.0))

    def standard(self, rows: Array) -> Array:
        """Return rows (N, d) standardised: minus the mean, divided by the standard deviation of each column."""
        found: Array = (rows - self.mean) / self.deviation
        return found

    def original(self, rows: Array) -> Array:
        """Return standardised rows (N, d) in the original units; the inverse of `standard`."""
        found: Array = rows * self.deviation + self.mean
        return found


class Regression:
    """A localiser that learns by a regression from `eye_features` to positions, both standardised.

    The estimator of the regression has the methods `fit` and `predict` of scikit-learn.
    """

    def __init__(self, lens: Lens, make: Callable[[], Any]) -> None:
        """Make a localiser that is not fitted yet.

        `lens`: of both cameras. `make`: a function without arguments that returns a new estimator, an object with the methods `fit` and
        `predict` of scikit-learn, which must predict all three coordinates at once, (M, 3).
        """
        self._lens, self._make = lens, make
        self._estimator: Any = None
        self._of_features = self._of_places = Scale(np.zeros(1), np.ones(1))

    def fit(self, inputs: Array, places: Array) -> None:
        """Learn from inputs (N, 13) and positions `places` (N, 3) m, root frame; everything learned before is discarded."""
        features = eye_features(inputs, self._lens)
        self._of_features, self._of_places = Scale.of(features), Scale.of(places)
        self._estimator = self._make()
        with warnings.catch_warnings():  # a length at its bound is that of an input that says nothing; STEPS are enough
            warnings.filterwarnings("ignore", message=".*(close to the specified (upper|lower) bound|lbfgs failed to converge).*")
            self._estimator.fit(self._of_features.standard(features), self._of_places.standard(places))

    def predict(self, inputs: Array) -> Array:
        """Return the predicted positions (M, 3) m, root frame, for inputs (M, 13)."""
        features = self._of_features.standard(eye_features(inputs, self._lens))
        found: Array = self._of_places.original(self._estimator.predict(features))
        return found


class CorrectedStereo:
    """A localiser that triangulates with the kinematic model; it learns corrections of camera mounts and encoder offsets.

    The corrections are found by robust least squares on the positions that are given to `fit`.
    """

    def __init__(self, rig: Rig) -> None:
        self._rig = rig
        self._x: Array = np.zeros(len(rig.names))

    def fit(self, inputs: Array, places: Array) -> None:
        """Learn the corrections from inputs (N, 13) and positions `places` (N, 3) m, root frame.

        Each correction has a prior with the mean 0 and the standard deviation from `CameraSettings().deviations`, that is, from the default
        tolerances. Everything learned before is discarded.
        """
        from scipy.optimize import least_squares

        rig = self._rig
        scale = rig.deviations(CameraSettings().deviations)
        used = slice(0, rig.where("encoder").stop)  # what a thing at rest says nothing about is behind

        def parameters(y: Array) -> Array:
            x = np.zeros(len(scale))
            x[used] = scale[used] * y
            return x

        def residuals(y: Array) -> Array:
            off = (stereo_places(rig, parameters(y), inputs) - places) / SPREAD
            return np.concatenate([np.nan_to_num(off, nan=FAR, posinf=FAR, neginf=-FAR).clip(-FAR, FAR).ravel(), y])

        start = np.zeros(len(scale[used]))
        self._x = parameters(least_squares(residuals, start, loss="soft_l1", max_nfev=ROUNDS).x)

    def predict(self, inputs: Array) -> Array:
        """Return the triangulated positions (M, 3) m, root frame, for inputs (M, 13); NaN where the rays are parallel."""
        return stereo_places(self._rig, self._x, inputs)


def stereo_places(rig: Rig, x: Array, inputs: Array) -> Array:
    """Return the positions (N, 3) m, root frame, that are nearest to the rays of both cameras; NaN where the rays are parallel.

    `x`: (P,) parameters of cameras and encoders, in the order of `Rig.names`. `inputs`: (N, 13), column and row of the thing in the left
    picture, then in the right one [px], then the encoders of torso and head [rad].
    """
    q = np.repeat(rig.robot.home[None], len(inputs), axis=0)
    q[:, seeing_motors(rig.robot)] = inputs[:, 4:]
    transforms = link_transforms(rig.robot, rig.posture(x, q, np.zeros_like(q)))
    origins, rays = [], []
    for number, (name, camera) in enumerate(rig.cameras.items()):
        position, rotation = camera_frames(camera, transforms, x[rig.where(name)])
        origins.append(position)
        rays.append(np.einsum("nij,nj->ni", rotation, rig.lens.unproject(inputs[:, 2 * number : 2 * number + 2])))
    return nearest_to_rays(np.stack(origins, axis=1), np.stack(rays, axis=1))


def _polynomial(seed: int) -> Any:
    sklearn = _sklearn()
    polynomial = sklearn.preprocessing.PolynomialFeatures(DEGREE)
    return sklearn.pipeline.make_pipeline(polynomial, sklearn.linear_model.RidgeCV(PENALTIES))


def _gaussian_process(seed: int) -> Any:
    process = _sklearn().gaussian_process
    kernels = process.kernels
    signal = kernels.ConstantKernel(10.0, (1e-2, 1e6)) * kernels.RBF(np.full(FEATURES, LENGTH), LENGTHS)
    return process.GaussianProcessRegressor(signal + kernels.WhiteKernel(1e-3, NOISE), random_state=seed)


def _network(seed: int) -> Any:
    network = _sklearn().neural_network.MLPRegressor
    return network(hidden_layer_sizes=(HIDDEN,), activation="tanh", solver="lbfgs", alpha=DECAY, max_iter=STEPS, random_state=seed)


def _programs(seed: int) -> Any:
    return CartesianPrograms(seed)


def _sklearn() -> Any:
    try:
        import sklearn.gaussian_process
        import sklearn.linear_model
        import sklearn.neural_network
        import sklearn.pipeline
        import sklearn.preprocessing
    except ImportError:
        raise NotInstalled('this localiser needs scikit-learn: pip install "mobee[vision]"') from None
    return sklearn


REGRESSIONS: Mapping[str, Callable[[int], Any]] = {
    "least squares": _polynomial,
    "Gaussian process": _gaussian_process,
    "neural network": _network,
    "genetic programming": _programs,
}
"""Functions by name of a regression that make its estimator from a seed; these regressions do not use the kinematic model."""
CORRECTED = "corrected stereo"
NAMES = (*REGRESSIONS, CORRECTED)


def localiser(name: str, rig: Rig, seed: int) -> Localiser:
    """Return a new localiser by its name, one of NAMES: a regression of REGRESSIONS, or "corrected stereo".

    `rig`: the robot and its cameras; a regression uses only the lens. `seed`: seed of the regression's random numbers. Raises UnknownName
    for another name. All regressions except "genetic programming" need scikit-learn: if it is not installed, their method `fit` raises
    NotInstalled.
    """
    if name == CORRECTED:
        return CorrectedStereo(rig)
    if name not in REGRESSIONS:
        raise UnknownName("localiser", name, NAMES)
    return Regression(rig.lens, lambda: REGRESSIONS[name](seed))
