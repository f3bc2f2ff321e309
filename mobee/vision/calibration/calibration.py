# SPDX-License-Identifier: Apache-2.0
"""Observations of the tag on a robot's palm, and the result of a calibration with its file."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mobee.arrays import Array
from mobee.errors import InvalidValue
from mobee.robot.robot import Camera, Robot
from mobee.robot.writing import write_whole
from mobee.vision.encoders import Moment
from mobee.vision.imperfections import CameraErrors
from mobee.vision.lens import Lens
from mobee.vision.rig import Rig
from mobee.vision.tag import Tag

FORMAT = "mobee calibration 1"


@dataclass(frozen=True, slots=True, eq=False)
class Observation:
    """The tag on the robot's palm in the pictures of all cameras with the same stamp (time of the picture).

    `moment`: the encoders at the stamp. `corners`: by name of the camera, the corners (4, 2) px of the tag, column and row, in the order of
    `Tag.corners`; a camera that does not see the tag is missing.
    """

    moment: Moment
    corners: Mapping[str, Array]


def stacked(observations: Sequence[Observation]) -> tuple[Array, Array, Array]:
    """Return the encoders q (N, n) rad, their velocities dq (N, n) rad/s and the variances of q (N, n) rad^2 of N observations."""
    moments = [one.moment for one in observations]
    return np.array([one.q for one in moments]), np.array([one.dq for one in moments]), np.array([one.variance for one in moments])


@dataclass(frozen=True, slots=True)
class Quality:
    """Distances of the observed tag on the palm from the position that a calibration's parameters predict: median and 95 % quantile.

    `pixels_*`: distances of corners in the pictures [px]. `metres_*`: distances of the middle of the tag in space [m].
    """

    pixels_median: float
    pixels_95: float
    metres_median: float
    metres_95: float

    @classmethod
    def of(cls, pixels: Array, metres: Array) -> Quality:
        """Return the medians and 95 % quantiles of distances between the observed and the predicted tag; NaN for an empty array.

        `pixels`: (K,) px, distances of corners in the pictures. `metres`: (N,) m, distances of the middle of the tag in space.
        """
        found = [np.quantile(one, share) if len(one) else np.nan for one in (pixels, metres) for share in (0.5, 0.95)]
        return cls(*(float(value) for value in found))


@dataclass(frozen=True, slots=True)
class Unobservable:
    """A direction in the space of the parameters about which the pictures give almost no information.

    It is a singular vector of the Jacobian: the derivatives of the residuals (in units of the noise) by the parameters (in units of their
    prior deviations). `information`: its singular value s. The pictures reduce the prior deviation along the direction to 1 / sqrt(1 + s^2)
    of its value; s = 0: no information at all. `weights`: components of the direction, a unit vector, by name of the parameter; small
    ones are left out.
    """

    information: float
    weights: Mapping[str, float]


@dataclass(frozen=True, slots=True, eq=False)
class Calibration:
    """The result of a calibration: by how much a robot's cameras and encoders differ from its model, and how uncertain this is.

    Attributes:
        robot: name of the robot.
        cameras: names of the cameras.
        lens: lens of all cameras.
        tag: the tag on the palm.
        pictures: number of observations that were used.
        names: names of the P parameters.
        x: (P,) the parameters in the order of `names`; m, rad and s.
        covariance: (P, P) of x.
        prior: (P,) standard deviations of the parameters before the calibration.
        misfit: mean square of the residuals, each divided by its assumed standard deviation; 1 if noise and model are as assumed.
        uncalibrated: distances of the observed tag from its predicted position, with all parameters 0.
        calibrated: distances of the observed tag from its predicted position, with the parameters x.
        unobservable: directions of the parameters that the pictures do not determine.
    """

    robot: str
    cameras: tuple[str, ...]
    lens: Lens
    tag: Tag
    pictures: int
    names: tuple[str, ...]
    x: Array
    covariance: Array
    prior: Array
    misfit: float
    uncalibrated: Quality
    calibrated: Quality
    unobservable: tuple[Unobservable, ...]

    @property
    def deviations(self) -> Array:
        """The standard deviations (P,) of the parameters after the calibration, in the order of `names`."""
        return np.sqrt(np.diag(self.covariance))

    def rig(self, robot: Robot, cameras: Mapping[str, Camera]) -> Rig:
        """Return the rig (robot, cameras, lens and tag) to which the parameters belong; `cameras`: those of the robot's model, by name.

        Raises InvalidValue if the robot or the cameras are not those of the calibration.
        """
        if robot.name != self.robot or not set(self.cameras) <= set(cameras):
            raise InvalidValue(
                f"the calibration is of {self.robot!r} with the cameras {', '.join(self.cameras)}; this is {robot.name!r} with "
                f"{', '.join(cameras) or 'none'}. Calibrate this robot: mobee calibrate"
            )
        rig = Rig(robot, {name: cameras[name] for name in self.cameras}, self.lens, self.tag)
        if rig.names != self.names:
            raise InvalidValue(f"the calibration has the parameters {', '.join(self.names)}; this robot has {', '.join(rig.names)}")
        return rig

    def errors(self, robot: Robot, cameras: Mapping[str, Camera]) -> CameraErrors:
        """Return the parameters in the form of CameraErrors; `cameras`: those of the robot's model, by name.

        Raises InvalidValue if the robot or the cameras are not those of the calibration.
        """
        return self.rig(robot, cameras).errors(self.x)

    def save(self, path: Path) -> Path:
        """Write the calibration to a JSON file, and return the file's path; raise OSError if it cannot be written."""
        plain = {
            "format": FORMAT,
            "units": "m, rad, s",
            "robot": self.robot,
            "cameras": list(self.cameras),
            "lens": list(self.lens.numbers),
            "tag": asdict(self.tag),
            "pictures": self.pictures,
            "parameters": {
                name: {"value": float(value), "deviation": float(deviation), "prior": float(prior)}
                for name, value, deviation, prior in zip(self.names, self.x, self.deviations, self.prior, strict=True)
            },
            "misfit": self.misfit,
            "uncalibrated": asdict(self.uncalibrated),
            "calibrated": asdict(self.calibrated),
            "unobservable": [{"information": one.information, "weights": dict(one.weights)} for one in self.unobservable],
            "covariance": self.covariance.tolist(),
        }
        return write_whole(path, (json.dumps(plain, indent=1) + "\n").encode())


def load_calibration(path: Path | str) -> Calibration:
    """Read a calibration from its file; raise InvalidValue if the file cannot be read or is no calibration."""
    try:
        plain: dict[str, Any] = json.loads(Path(path).read_text(encoding="utf-8"))
    except OSError as error:
        raise InvalidValue(f"{path}: cannot be read ({error.strerror})") from None
    except ValueError as error:
        raise InvalidValue(f"{path}: not JSON: {error}. `mobee calibrate --save FILE` writes such a file.") from None
    if not isinstance(plain, dict) or plain.get("format") != FORMAT:
        raise InvalidValue(f"{path}: not a file of `mobee calibrate`: its format must be {FORMAT!r}")
    try:
        return _read(plain)
    except (KeyError, TypeError, ValueError) as error:
        raise InvalidValue(f"{path}: a damaged calibration: {type(error).__name__}: {error}. Calibrate again: mobee calibrate") from None


def _read(plain: Mapping[str, Any]) -> Calibration:
    parameters = plain["parameters"]
    x, prior = (np.array([one[field] for one in parameters.values()], dtype=np.float64) for field in ("value", "prior"))
    covariance = np.array(plain["covariance"], dtype=np.float64)
    if covariance.shape != (len(x), len(x)) or not all(np.isfinite(one).all() for one in (x, prior, covariance)):
        raise ValueError(f"{len(x)} parameters with a covariance of shape {covariance.shape}; all must be finite")
    variance = np.diag(covariance)
    if not ((variance >= 0.0).all() and (np.abs(covariance - covariance.T) <= 1e-3 * np.sqrt(np.outer(variance, variance))).all()):
        raise ValueError("a covariance that is not symmetric, or has a variance below 0")
    return Calibration(
        robot=str(plain["robot"]),
        cameras=tuple(plain["cameras"]),
        lens=Lens(*plain["lens"]),
        tag=Tag(**plain["tag"]),
        pictures=int(plain["pictures"]),
        names=tuple(parameters),
        x=x,
        covariance=covariance,
        prior=prior,
        misfit=float(plain["misfit"]),
        uncalibrated=Quality(**plain["uncalibrated"]),
        calibrated=Quality(**plain["calibrated"]),
        unobservable=tuple(Unobservable(float(one["information"]), dict(one["weights"])) for one in plain["unobservable"]),
    )
