# SPDX-License-Identifier: Apache-2.0
"""Estimates offsets of encoders while a robot acts and sees its own hand: an extended Kalman filter, and a plant that uses the estimate."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np

from mobee.arrays import Array
from mobee.control.forces import checked
from mobee.errors import ActionInterrupted, InvalidValue, UnknownName
from mobee.model.model import Model
from mobee.plant import Described, Outcome
from mobee.reach import ReachOutcome, ReachPlant, ReachTarget

NOISE = 0.005  # m: standard deviation of a seen place along each axis
KNOWN, UNKNOWN = np.deg2rad(0.3), np.deg2rad(10.0)  # rad: standard deviations of an offset at the start; added when a change is detected
SURPRISE = 21.1  # squared distance of a seen place, in standard deviations; a correct one exceeds it once in 10 000 (chi-squared)
LARGEST_CHANGE = 3.0 * UNKNOWN  # rad: changes of an offset beyond this are taken for wrong measurements
ITERATIONS = 5  # of the linearisation in each observation
STIFFNESS = 0.02  # m/rad: weight of the joints' motion where the end of a reach is predicted
STEPS = 20  # of that prediction


class JointOffsets:
    """Estimates the offsets (true minus measured angle) of a robot's encoders from positions at which a marker is seen.

    It is an extended Kalman filter with a constant state. If two successive seen positions are improbable under the estimate, and changed
    offsets explain both, the filter concludes that the offsets have changed: it becomes uncertain, and uses both positions. Other
    improbable positions are treated as wrong measurements and ignored. Old positions keep their weight until a change is detected. A change
    that displaces the marker by less than about five times `noise` may not be detected; then the estimate follows slowly, and its
    covariance is too small.

    Args:
        model: the robot; its world does not matter.
        marker: name of the marker that is seen.
        motors: names of the motors with unknown offsets, each of which must move the marker.  The offsets of all other motors are taken as
            0.
        noise: m, standard deviation of a seen position along each axis.

    Raises:
        UnknownName: no such marker or motor.
        InvalidValue: no motor, a motor that does not move the marker or is named twice, or a noise that is not positive.
    """

    def __init__(self, model: Model, marker: str, motors: Sequence[str], noise: float = NOISE) -> None:
        robot = model.robot
        if unknown := [name for name in motors if name not in robot.motors]:
            raise UnknownName("motor", unknown[0], robot.motors)
        self.model, self.marker, self.motors = model, marker, tuple(motors)
        self._where = [robot.motor_index(name) for name in motors]
        movers = [robot.motors[index] for index in np.flatnonzero(model.jacobian(robot.home, marker).any(axis=0))]
        if len(set(motors)) != len(motors):
            raise InvalidValue(f"motors {list(motors)}: name each motor once")
        if not motors or not set(motors) <= set(movers):
            raise InvalidValue(f"motors {list(motors)}: name one or more of those that move {marker!r}: {', '.join(movers)}")
        if not 0.0 < noise < np.inf:
            raise InvalidValue(f"noise {noise!r} m: must be a finite length above 0")
        self.offsets: Array = np.zeros(len(motors))
        """The estimated offsets, (d,) rad, in the order of `motors`; encoder value plus offset is the true angle."""
        self.covariance: Array = KNOWN**2 * np.eye(len(motors))
        """Covariance of the estimated offsets, (d, d) rad^2."""
        self.observations = 0
        """Number of seen positions so far, ignored ones included."""
        self.changes: list[int] = []
        """Numbers (from 1) of the observations at which a change of the offsets was detected."""
        self._noise = noise**2 * np.eye(3)
        self._surprise: tuple[Array, Array] | None = None  # the last observation, if it was improbable

    @property
    def all_offsets(self) -> Array:
        """The offsets (n,) rad of all motors of the robot: 0 for motors without an estimate."""
        found = np.zeros(len(self.model.robot.motors))
        found[self._where] = self.offsets
        return found

    def observe(self, q: Array, seen: Array) -> bool:
        """Update the estimate with a position at which the marker is seen; return whether a change of the offsets was detected.

        Args:
            q: encoder values of all motors (n,) rad, uncorrected, while the robot rests.
            seen: position (3,) m of the marker, root frame.

        Raises:
            InvalidValue: `q` or `seen` has another shape or is not finite.
        """
        measured, place = checked("q", q, len(self.model.robot.motors)), checked("seen", seen, 3)
        self.observations += 1
        if self._distance(measured, place) <= SURPRISE:
            self._surprise = None
            self._update(measured, place)
            return False
        before, self._surprise = self._surprise, (measured, place)
        if before is None or not self._is_change(before, (measured, place)):
            return False
        self._surprise = None
        self.changes.append(self.observations)
        return True

    def _is_change(self, first: tuple[Array, Array], second: tuple[Array, Array]) -> bool:
        """Return whether changed offsets explain two successive improbable observations (q, seen).

        If they do, the estimate is updated with both; else it remains as it was. The covariance is widened for this test. The offsets
        explain both if both observations are then probable, and no offset has changed by more than LARGEST_CHANGE.
        """
        offsets, covariance = self.offsets, self.covariance
        self.covariance = covariance + UNKNOWN**2 * np.eye(len(offsets))
        self._update(*first)
        if self._distance(*second) <= SURPRISE:
            self._update(*second)
            if max(self._distance(*first), self._distance(*second)) <= SURPRISE and np.abs(self.offsets - offsets).max() <= LARGEST_CHANGE:
                return True
        self.offsets, self.covariance = offsets, covariance
        return False

    def _predicted_place(self, q: Array, offsets: Array) -> tuple[Array, Array]:
        """Return the place (3,) m of the marker with these offsets, and its derivatives (3, d) by them."""
        posture = q.copy()
        posture[self._where] += offsets
        jacobian = self.model.jacobian(posture, self.marker)[:3, self._where]
        return self.model.evaluate(posture).position(self.marker), jacobian

    def _distance(self, q: Array, seen: Array) -> float:
        """Return the squared distance of a seen place from the predicted one, in standard deviations of both."""
        place, jacobian = self._predicted_place(q, self.offsets)
        spread = jacobian @ self.covariance @ jacobian.T + self._noise
        return float((seen - place) @ np.linalg.solve(spread, seen - place))

    def _update(self, q: Array, seen: Array) -> None:
        """Update the estimate and its covariance with an observation, by an iterated extended Kalman filter.

        The prediction is linearised ITERATIONS times, each time at the newest estimate. `q`: encoder values (n,) rad. `seen`: position (3,)
        m of the marker, root frame.
        """
        before, estimate = self.offsets, self.offsets
        for _ in range(ITERATIONS):
            place, jacobian = self._predicted_place(q, estimate)
            gain = np.linalg.solve(jacobian @ self.covariance @ jacobian.T + self._noise, jacobian @ self.covariance).T
            estimate = before + gain @ (seen - place - jacobian @ (before - estimate))
        rest = np.eye(len(before)) - gain @ jacobian
        self.offsets, self.covariance = estimate, rest @ self.covariance @ rest.T + gain @ self._noise @ gain.T


class SelfCalibratingPlant:
    """A plant for agents that corrects the encoder values of another plant, from positions at which the robot's hand is seen.

    So each state of an agent still means the same true posture after the encoders have become wrong. After each action that leaves the
    robot at rest, `see` is called once and the estimate is updated, also while an agent is only evaluated and does not learn. Targets and
    results of actions are in corrected values. For a reach, the target is shifted such that the plant, which uses uncorrected values,
    brings the true marker to the wanted position. Forces of contacts and limits are computed from uncorrected values.

    Args:
        plant: the plant, offline or live, whose encoders may be wrong.
        offsets: estimates the offsets of its encoders.
        see: returns the position at which the marker is seen at present, (3,) m in the root frame; None or NaN if it is not seen.

    Raises:
        InvalidValue: `offsets` belongs to another robot.
    """

    def __init__(self, plant: ReachPlant, offsets: JointOffsets, see: Callable[[], Array | None]) -> None:
        if plant.robot.motors != offsets.model.robot.motors:
            raise InvalidValue(f"the plant moves {plant.robot.name!r}, the offsets are of {offsets.model.robot.name!r}: use one robot.")
        self.plant, self.robot, self.offsets, self._see = plant, plant.robot, offsets, see
        self._target: ReachTarget | None = None

    @property
    def settings(self) -> dict[str, Any]:
        """The settings of the corrected plant (the argument `plant`) as plain JSON values; empty if it has none."""
        return self.plant.settings if isinstance(self.plant, Described) else {}

    @property
    def q(self) -> Array:
        """The present corrected positions of all motors (encoder plus offset), (n,) rad."""
        return self.plant.q + self.offsets.all_offsets

    def measure(self, part: str) -> Array:
        """Return the present corrected positions of the part's motors (encoder plus offset), (n_part,) rad."""
        return self.plant.measure(part) + self._of(part)

    def act(self, part: str, target: Array) -> Outcome:
        """Move the part to a target and wait until it settles or times out; return the outcome, with corrected positions.

        `target`: (n_part,) rad, the attractor (the pose to which the controller pulls the part) in corrected values, which must be within
        the motors' limits. The plant gets the target minus the offsets; a value of this difference beyond a limit is replaced by the limit.
        Raises InvalidValue for a target beyond the limits, or that the plant refuses, and ActionInterrupted if a hold (a safe stop), a
        fault or a restart of the robot ends the action.
        """
        offsets = self._of(part)
        if offsets.any():
            low, high = self.robot.limits[self.robot.part(part).slice].T
            wanted = checked("target", target, len(low))
            if (wanted < low).any() or (wanted > high).any():
                raise InvalidValue(f"target of {part}: beyond the limits of its motors; give values within robot.limits")
            target = np.clip(wanted - offsets, low, high)
        outcome = self.plant.act(part, target)
        self._look(outcome.settled)
        return self._corrected(part, outcome)

    def present(self, target: ReachTarget | None) -> None:
        """Set the target of the next reaches; None: remove the target."""
        self.plant.present(target)
        self._target = target

    def reach(self, part: str, marker: str, stay: bool = False) -> ReachOutcome:
        """Reach with a marker to the target that `present` has set; return the outcome, computed from corrected encoder values.

        In a reach, a force pulls the marker to the target, until the part has settled or a time limit is over; then the force ends. `part`:
        name of the part that moves. `marker`: name of the marker, a point on a link of the part. `stay`: True: the part stays in the pose
        that it has at the end of the force; False: it returns to the target of its last action. If an estimated encoder offset is not 0,
        `q` and `after.q` of the outcome are encoder values plus offsets, (n_part,) rad, and `marker` and `missing` are computed from this
        `q`. Raises InvalidValue if no target is set. It is also raised if an estimated offset is not 0 and the target prescribes a
        direction of the marker's normal (`ReachTarget.normal` or `faces`), because this direction is not corrected. Raises
        ActionInterrupted if a hold (a safe stop), a fault or a restart of the robot ends the reach.
        """
        if self._target is None:
            raise InvalidValue("no target is presented; call present(ReachTarget(position)) first")
        offsets = self.offsets.all_offsets
        if not offsets.any():
            found = self.plant.reach(part, marker, stay)
        else:
            if self._target.faces or self._target.normal is not None:
                raise InvalidValue("the target has a direction of the marker's normal, which is not corrected: give a target without")
            self.plant.present(replace(self._target, position=self._aim(part, marker, self._target, offsets)))
            try:
                found = self.plant.reach(part, marker, stay)
            finally:
                with suppress(ActionInterrupted):  # a live model that does not answer has no target either; the reach has ended and counts
                    self.plant.present(self._target)
        self._look(found.after.settled)
        if not self.offsets.all_offsets.any():
            return found
        where = self.robot.part(part).slice
        posture = self.q
        posture[where] = found.q + self._of(part)
        place = self._place(marker, posture)
        return replace(found, marker=place, q=posture[where], missing=self._target.missing(place), after=self._corrected(part, found.after))

    def _of(self, part: str) -> Array:
        return self.offsets.all_offsets[self.robot.part(part).slice]

    def _corrected(self, part: str, outcome: Outcome) -> Outcome:
        return replace(outcome, q=outcome.q + self._of(part))

    def _look(self, rests: bool) -> None:
        if rests and (seen := self._see()) is not None and np.isfinite(seen).all():
            self.offsets.observe(self.plant.q, seen)

    def _place(self, marker: str, posture: Array) -> Array:
        return self.offsets.model.evaluate(posture).position(marker)

    def _aim(self, part: str, marker: str, target: ReachTarget, offsets: Array) -> Array:
        """Return the position (3,) m to which the plant, with uncorrected values, must reach."""
        end = self._end_of_reach(part, marker, target)
        aim: Array = target.position + self._place(marker, end - offsets) - self._place(marker, end)
        return aim

    def _end_of_reach(self, part: str, marker: str, target: ReachTarget) -> Array:
        """Return the corrected posture (n,) rad in which a reach from the present one will about end: damped least squares."""
        begin, where, model = self.q, self.robot.part(part).slice, self.offsets.model
        posture, damping, (low, high) = begin.copy(), STIFFNESS**2, self.robot.limits[where].T
        for _ in range(STEPS):
            away = target.position - self._place(marker, posture)
            if target.aim == "surface":
                away *= target.missing(target.position - away) / max(float(np.linalg.norm(away)), 1e-9)
            jacobian = model.jacobian(posture, marker)[:3, where]
            pull = jacobian.T @ away + damping * (begin - posture)[where]
            step = np.linalg.solve(jacobian.T @ jacobian + damping * np.eye(len(pull)), pull)
            posture[where] = np.clip(posture[where] + step, low, high)
        return posture
