# SPDX-License-Identifier: Apache-2.0
"""Offsets of encoders, found while a robot acts and sees its own hand: an extended Kalman filter, and a plant that is corrected by it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mobee.arrays import Array, real_array
from mobee.errors import InvalidValue, UnknownName
from mobee.model.model import Model
from mobee.plant import Described, Outcome
from mobee.reach import ReachOutcome, ReachPlant, ReachTarget

NOISE = 0.005  # m: standard deviation of a seen place along each axis
KNOWN, UNKNOWN = np.deg2rad(0.3), np.deg2rad(10.0)  # rad: standard deviations of an offset as a rule, and after a change
SURPRISE = 21.1  # squared distance of a seen place, in standard deviations, which chance exceeds once in 10 000 (chi-squared, 3 degrees)
ITERATIONS = 5  # of the linearisation in each observation
STIFFNESS = 0.02  # m/rad: weight of the joints' motion where the end of a reach is predicted
STEPS = 20  # of that prediction


class JointOffsets:
    """Estimates by how much encoders of a robot are wrong, from places where a marker is seen: true minus measured angle of each motor.

    An extended Kalman filter whose state is constant.  Two seen places in a row that are improbable under the estimate mean that the
    offsets have changed: the filter becomes uncertain, and both places count.  A single one is taken for an error of the eyes, and
    ignored.  So there is no rate of forgetting, and an estimate without a change becomes more certain with every place.

    Args:
        model: the robot; its world does not matter.
        marker: what is seen.
        motors: names of the motors with unknown offsets.  Only offsets that move the marker can be found; others stay as they are.
        noise: m, standard deviation of a seen place along each axis.

    Raises:
        UnknownName: no such marker or motor.
        InvalidValue: no motor, a motor that does not move the marker, or a noise that is not positive.
    """

    def __init__(self, model: Model, marker: str, motors: Sequence[str], noise: float = NOISE) -> None:
        robot = model.robot
        if unknown := [name for name in motors if name not in robot.motors]:
            raise UnknownName("motor", unknown[0], robot.motors)
        self.model, self.marker, self.motors = model, marker, tuple(motors)
        self._where = [robot.motor_index(name) for name in motors]
        movers = [robot.motors[index] for index in np.flatnonzero(model.jacobian(robot.home, marker).any(axis=0))]
        if not motors or not set(motors) <= set(movers):
            raise InvalidValue(f"motors {list(motors)}: name one or more of those that move {marker!r}: {', '.join(movers)}")
        if not 0.0 < noise < np.inf:
            raise InvalidValue(f"noise {noise!r} m: must be a finite length above 0")
        self.offsets: Array = np.zeros(len(motors))
        """The estimate, (d,) rad, in the order of `motors`; to be added to encoder values."""
        self.covariance: Array = KNOWN**2 * np.eye(len(motors))
        """Of the estimate, (d, d) rad^2."""
        self.observations = 0
        """Number of seen places so far."""
        self.changes: list[int] = []
        """Numbers of the observations at which a change of the offsets was detected."""
        self._noise = noise**2 * np.eye(3)
        self._surprise: tuple[Array, Array] | None = None  # the last observation, if it was improbable

    @property
    def all_offsets(self) -> Array:
        """The offsets (n,) rad of all motors of the robot: 0 where none is estimated."""
        found = np.zeros(len(self.model.robot.motors))
        found[self._where] = self.offsets
        return found

    def observe(self, q: ArrayLike, seen: ArrayLike) -> bool:
        """Learn from where the marker is seen; return whether a change of the offsets was detected.

        Args:
            q: encoder values of all motors (n,) rad, uncorrected, while the robot rests.
            seen: place (3,) m, root frame.

        Raises:
            InvalidValue: a place that is not three finite numbers.
        """
        measured, place = np.array(q, dtype=np.float64), real_array("seen", seen)
        if place.shape != (3,) or not np.isfinite(place).all():
            raise InvalidValue(f"seen {place.tolist()}: must be three finite numbers, in m in the root frame")
        self.observations += 1
        if self._distance(measured, place) <= SURPRISE:
            self._surprise = None
            self._update(measured, place)
            return False
        if self._surprise is None:
            self._surprise = (measured, place)
            return False
        self.covariance = self.covariance + UNKNOWN**2 * np.eye(len(self.offsets))
        self._update(*self._surprise)
        self._update(measured, place)
        self._surprise = None
        self.changes.append(self.observations)
        return True

    def _predicted(self, q: Array, offsets: Array) -> tuple[Array, Array]:
        """Return the place (3,) m of the marker with these offsets, and its derivatives (3, d) by them."""
        posture = q.copy()
        posture[self._where] += offsets
        jacobian = self.model.jacobian(posture, self.marker)[:3, self._where]
        return self.model.evaluate(posture).position(self.marker), jacobian

    def _distance(self, q: Array, seen: Array) -> float:
        """Return the squared distance of a seen place from the predicted one, in standard deviations of both."""
        place, jacobian = self._predicted(q, self.offsets)
        spread = jacobian @ self.covariance @ jacobian.T + self._noise
        return float((seen - place) @ np.linalg.solve(spread, seen - place))

    def _update(self, q: Array, seen: Array) -> None:
        """Count an observation, linearised at the estimate that includes it (iterated extended Kalman filter)."""
        before, estimate = self.offsets, self.offsets
        for _ in range(ITERATIONS):
            place, jacobian = self._predicted(q, estimate)
            gain = np.linalg.solve(jacobian @ self.covariance @ jacobian.T + self._noise, jacobian @ self.covariance).T
            estimate = before + gain @ (seen - place - jacobian @ (before - estimate))
        rest = np.eye(len(before)) - gain @ jacobian
        self.offsets, self.covariance = estimate, rest @ self.covariance @ rest.T + gain @ self._noise @ gain.T


class SelfCalibratingPlant:
    """A ReachPlant whose encoders are corrected by where its hand is seen, so that an agent finds its states where they were.

    After each action that leaves the robot at rest, the marker is looked for once.  Encoder values of outcomes are corrected, and
    targets of actions are given in corrected values.  For a reach, the target is presented to the plant where the plant's uncorrected
    kinematics must pull the marker; the outcome's marker and remaining error follow from the corrected ones.

    Args:
        plant: whose encoders may be wrong, offline or live.
        offsets: what is known of them.
        see: returns where the marker is seen at present, (3,) m in the root frame, or None if it is not seen.

    Raises:
        InvalidValue: `offsets` of another robot.
    """

    def __init__(self, plant: ReachPlant, offsets: JointOffsets, see: Callable[[], Array | None]) -> None:
        if plant.robot.motors != offsets.model.robot.motors:
            raise InvalidValue(f"the plant moves {plant.robot.name!r}, the offsets are of {offsets.model.robot.name!r}: use one robot.")
        self.plant, self.robot, self.offsets, self._see = plant, plant.robot, offsets, see
        self._target: ReachTarget | None = None

    @property
    def settings(self) -> dict[str, Any]:
        """The settings of the plant, if it has any; see Described."""
        return self.plant.settings if isinstance(self.plant, Described) else {}

    @property
    def q(self) -> Array:
        """See Plant; corrected."""
        return self.plant.q + self.offsets.all_offsets

    def measure(self, part: str) -> Array:
        """See Plant; corrected."""
        return self.plant.measure(part) + self._of(part)

    def act(self, part: str, target: Array) -> Outcome:
        """See Plant; the target, as all values, is corrected; where it is beyond an uncorrected limit, the motor stops there."""
        low, high = self.robot.limits[self.robot.part(part).slice].T
        outcome = self.plant.act(part, np.clip(target - self._of(part), low, high))
        self._look(outcome.settled)
        return self._corrected(part, outcome)

    def present(self, target: ReachTarget | None) -> None:
        """See ReachPlant."""
        self._target = target
        self.plant.present(target)

    def reach(self, part: str, marker: str, stay: bool = False) -> ReachOutcome:
        """See ReachPlant."""
        if self._target is None:
            raise InvalidValue("no target is presented; call present(ReachTarget(position)) first")
        target, offsets = self._target, self.offsets.all_offsets
        if offsets.any():
            end = self._end_of_reach(part, marker, target.position)
            aim = target.position + self._place(marker, end - offsets) - self._place(marker, end)
            self.plant.present(replace(target, position=aim))
        try:
            found = self.plant.reach(part, marker, stay)
        finally:
            self.plant.present(target)
        posture = self.plant.q + offsets
        posture[self.robot.part(part).slice] = found.q + offsets[self.robot.part(part).slice]
        place = self._place(marker, posture)
        self._look(found.after.settled)
        return replace(
            found,
            marker=place,
            q=posture[self.robot.part(part).slice],
            missing=target.missing(place),
            after=self._corrected(part, found.after),
        )

    def _of(self, part: str) -> Array:
        return self.offsets.all_offsets[self.robot.part(part).slice]

    def _corrected(self, part: str, outcome: Outcome) -> Outcome:
        return replace(outcome, q=outcome.q + self._of(part))

    def _look(self, rests: bool) -> None:
        if rests and (seen := self._see()) is not None:
            self.offsets.observe(self.plant.q, seen)

    def _place(self, marker: str, posture: Array) -> Array:
        return self.offsets.model.evaluate(posture).position(marker)

    def _end_of_reach(self, part: str, marker: str, target: Array) -> Array:
        """Return the corrected posture (n,) rad in which a reach from the present one will about end: damped least squares."""
        begin, where, model = self.q, self.robot.part(part).slice, self.offsets.model
        posture, damping = begin.copy(), STIFFNESS**2
        for _ in range(STEPS):
            jacobian = model.jacobian(posture, marker)[:3, where]
            pull = jacobian.T @ (target - self._place(marker, posture)) + damping * (begin - posture)[where]
            posture[where] += np.linalg.solve(jacobian.T @ jacobian + damping * np.eye(len(pull)), pull)
        return posture
