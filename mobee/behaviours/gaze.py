# SPDX-License-Identifier: Apache-2.0
"""Gaze: neck and eyes keep a place in the middle of the pictures of all cameras.

The eyes are the part's motors that move cameras but none of the robot's shapes, the volumes that are tested for contacts. They point the
cameras at the target. Their goal is computed for the posture that all other motors will have after the delay of the motors, so that the
eyes also compensate the motion of neck and torso (the vestibulo-ocular reflex). The neck is the part's other motors that move cameras; they
move to the posture in which the eyes are in the middle of their range. A `Reference` (a speed-limited trajectory) moves both to their
goals: at full speed while the target is far from the middle of the pictures (a saccade), and with the target's own velocity near it (smooth
pursuit).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mobee.arrays import Array, Ints
from mobee.behaviours.tracking import Reference
from mobee.control.forces import checked
from mobee.errors import InvalidValue
from mobee.model.kinematics import cross, joint_axes, link_transforms, tables
from mobee.robot.cameras import camera_frame
from mobee.robot.robot import Camera, Robot

Phase = Literal["saccade", "pursuit"]

LAG = 0.08  # s from a change of the commanded velocity to that of the motor: lag, delay and a tick of the simulated motors
STEPS, ENOUGH = 4, 1e-3  # of Gauss and Newton; rad by which a motor still moves: the error after the step is its square
EYE_DAMPING, NECK_DAMPING = 1e-4, 3e-2  # squared weights of a motor's distance from the middle of its range; that of an angle is 1
SACCADE_ABOVE, PURSUIT_BELOW = np.deg2rad(6.0), np.deg2rad(3.0)  # angle between a direction of view and the target
ALIKE = 0.3  # rad per rad: vergence, which turns one eye to the left and the other to the right, turns the mean direction by less
FAR = 2.0  # m


@dataclass(frozen=True, slots=True, eq=False)
class Movement:
    """How a part should move at present, in the form that `Controller.follow` needs.

    `q`: (n_part,) rad, positions. `velocity`: (n_part,) rad/s. `phase`: "saccade" (fast motion to a target far from the middle of the
    pictures) or "pursuit" (motion with a target near the middle). `error`: present angle between a camera's direction of view and the
    target, the largest of all cameras [rad].
    """

    q: Array
    velocity: Array
    phase: Phase
    error: float


class Gaze:
    """Points the cameras of a robot at a target, with the motors of one part; it keeps its reference motion between calls of `step`."""

    def __init__(
        self,
        robot: Robot,
        cameras: Mapping[str, Camera],
        part: str,
        margin: Array | float = 0.0,
        lag: float = LAG,
        movable: NDArray[np.bool_] | None = None,
    ) -> None:
        """Find the motors of the part that move cameras.

        Args:
            robot: the robot.
            cameras: the cameras that are pointed at the target, by name, as `cameras_of` returns them.
            part: the part that may move.
            margin: (n,) rad, or one number, distance kept from each limit, at most a quarter of a motor's range.
            lag: s, delay of the motors' velocity after the commanded velocity.
            movable: (n,) whether each motor may be moved; None: all.

        Raises:
            InvalidValue: the part moves none of the cameras.
            UnknownName: the robot does not have the part.
        """
        self.robot, self.part, self.lag = robot, robot.part(part), lag
        self._cameras = tuple(cameras.values())
        self.eyes, self.neck = gaze_motors(robot, part, (camera.link for camera in self._cameras), movable)
        (low, high), middle = robot.limits.T, robot.limits.mean(axis=1)
        spare = np.minimum(margin, 0.25 * (high - low))
        self._low, self._high, self._middle = low + spare, high - spare, middle
        self._centring = self._eyes_to_centre()
        self._reference: Reference | None = None
        self._neck = middle[self.neck]
        self._phase: Phase = "saccade"

    def reset(self) -> None:
        """Discard the reference motion; the next call of `step` starts a new one from rest."""
        self._reference = None

    def offsets(self, q: Array, target: Array) -> Array:
        """Return the position of a target (3,) m, root frame, in the frame of each camera at posture q (n,) rad, (cameras, 3) m.

        The axes of a camera's frame are right, down and ahead.
        """
        transforms = link_transforms(self.robot, q)
        return np.array([_seen(camera, transforms, target) for camera in self._cameras])

    def error(self, q: Array, target: Array) -> float:
        """Return the largest angle [rad], over all cameras, between the direction of view at q (n,) rad and the direction to a target.

        `target`: (3,) m, root frame.
        """
        seen = self.offsets(q, target)
        return float(np.arctan2(np.hypot(seen[:, 0], seen[:, 1]), seen[:, 2]).max())

    def step(self, q: Array, velocity: Array, target: Array, target_velocity: Array, dt: float) -> Movement:
        """Return how the part should move at present so that the target stays in the middle of the pictures.

        Args:
            q: (n,) rad, measured positions of all motors.
            velocity: (n,) rad/s, commanded velocities of all motors.
            target: (3,) m, root frame, at the time of `q`.
            target_velocity: (3,) m/s, root frame.
            dt: time since the last call [s].

        Raises:
            InvalidValue: an argument has another shape, or a number is not finite, or `dt` is not above 0; then nothing changes.
        """
        q, velocity = (checked(name, one, len(self.robot.motors)) for name, one in (("q", q), ("velocity", velocity)))
        target, target_velocity = checked("target", target, 3), checked("target_velocity", target_velocity, 3)
        if not 0.0 < dt < np.inf:
            raise InvalidValue(f"dt {dt} s: must be a finite time above 0")
        span, error = self.part.slice, self.error(q, target)
        self._phase = "saccade" if error > SACCADE_ABOVE else "pursuit" if error < PURSUIT_BELOW else self._phase
        there = q + self.lag * velocity
        if self._reference is None:
            self._reference = Reference(self.robot, span, there[span], self._low[span], self._high[span])
        goal, moving = self._goal(there, velocity, target + self.lag * target_velocity, target_velocity)
        reference = self._reference
        reference.catch_up(goal[span], moving[span], there[span], dt)
        return Movement(reference.q - self.lag * reference.velocity, reference.velocity, self._phase, error)

    def _goal(self, q: Array, velocity: Array, target: Array, target_velocity: Array) -> tuple[Array, Array]:
        """Return the posture (n,) in which the cameras point at the target, and the velocities (n,) with which they keep pointing at it.

        The eyes' goal may be out of their range: they wait at its end until the neck has brought it into the range.
        """
        goal, moving = q.copy(), np.zeros(len(q))
        if len(self.eyes):
            slopes, drift = self._point(goal, self.eyes, EYE_DAMPING, target, bounded=not len(self.neck))
            moving[self.eyes] = _compensating(slopes, drift @ target_velocity, velocity, self.eyes, EYE_DAMPING)
        if len(self.neck):
            centred, others = goal.copy(), velocity.copy()
            centred[self._centring], others[self.eyes] = self._middle[self._centring], 0.0
            centred[self.neck] = self._neck
            damping = NECK_DAMPING if len(self.eyes) else EYE_DAMPING
            slopes, drift = self._point(centred, self.neck, damping, target, bounded=True)
            goal[self.neck] = self._neck = centred[self.neck]
            inside = (self._neck > self._low[self.neck]) & (self._neck < self._high[self.neck])
            moving[self.neck] = inside * _compensating(slopes, drift @ target_velocity, others, self.neck, damping)
        return goal, moving

    def _point(self, q: Array, motors: Ints, damping: float, target: Array, bounded: bool) -> tuple[Array, Array]:
        """Change these motors in q so that the cameras point best at the target, by damped least squares.

        Returns the derivatives of the angles by the motors, (2 cameras, n), and by the target's place, (2 cameras, 3).
        """
        low, high = self._low[motors], self._high[motors]
        if not bounded:
            low, high = self._middle[motors] - np.pi, self._middle[motors] + np.pi
        for _ in range(STEPS):
            angles, slopes, moved = self._angles(q, target)
            slope, here = slopes[:, motors], np.clip(q[motors], low, high)
            pull = slope.T @ angles + damping * (here - self._middle[motors])
            free = ~((here <= low) & (pull > 0.0) | (here >= high) & (pull < 0.0))
            step = np.zeros(len(motors))
            step[free] = -np.linalg.solve(slope[:, free].T @ slope[:, free] + damping * np.eye(int(free.sum())), pull[free])
            q[motors] = np.clip(here + step, low, high)
            if float(np.abs(q[motors] - here).max()) < ENOUGH:
                break
        return slopes, moved

    def _angles(self, q: Array, target: Array) -> tuple[Array, Array, Array]:
        """Return the angles (2 cameras,) rad by which the target is to the right of and below the directions of view at q (n,).

        And their derivatives by the motors, (2 cameras, n), and by the target's place, (2 cameras, 3) rad/m.
        """
        constants, transforms = tables(self.robot), link_transforms(self.robot, q)
        axes, points = joint_axes(self.robot, transforms)
        arms = cross(target - points, axes) * constants.revolute[:, None] - axes * (1.0 - constants.revolute[:, None])
        angles, by_motors, by_target = [], [], []
        for camera in self._cameras:
            chain = constants.ancestry[camera.link]
            position, rotation = camera_frame(camera, transforms)
            seen = rotation.T @ (target - position)
            slope = _angle_slope(seen) @ rotation.T
            angles.append(_angles_of(seen))
            by_motors.append(slope @ arms[chain].T @ constants.coupling[:, chain].T)
            by_target.append(slope)
        return np.concatenate(angles), np.concatenate(by_motors), np.concatenate(by_target)

    def _eyes_to_centre(self) -> Ints:
        """Return the indices of the eyes' motors that turn all cameras in the same direction (so not those that only make them converge).

        The neck moves so that these motors come to the middle of their range.
        """
        if not len(self.eyes):
            return self.eyes
        home = self.robot.home
        frames = [camera_frame(camera, link_transforms(self.robot, home)) for camera in self._cameras]
        ahead = np.mean([place + FAR * rotation[:, 2] for place, rotation in frames], axis=0)
        turned = self._angles(home, ahead)[1][:, self.eyes].reshape(len(self._cameras), 2, -1)
        alike: Ints = self.eyes[np.abs(turned.mean(axis=0)).max(axis=0) > ALIKE]
        return alike


def gaze_motors(robot: Robot, part: str, links: Iterable[int], movable: NDArray[np.bool_] | None = None) -> tuple[Ints, Ints]:
    """Return the indices of the motors of a part that move at least one of the links: the eyes and the neck.

    The first array has the eyes: the motors that move none of the robot's shapes, the volumes that are tested for contacts. The second has
    all others (the neck). `links`: indices of the links that carry cameras. `movable`: (n,) whether each motor may be moved; None: all.
    Raises InvalidValue if there are no such motors, and UnknownName for an unknown part.
    """
    span, matrix, ancestry = robot.part(part).slice, robot.coupling[0], tables(robot).ancestry
    turning, bodies = (np.zeros(len(robot.motors), dtype=bool) for _ in range(2))
    for link in links:
        turning |= (matrix[ancestry[link]] != 0.0).any(axis=0)
    turning[: span.start] = turning[span.stop :] = False
    turning &= True if movable is None else movable
    if not turning.any():
        raise InvalidValue(f"{part} of {robot.name!r} turns none of the cameras: name the part that carries them")
    for shape in robot.shapes:
        bodies |= (matrix[ancestry[shape.link]] != 0.0).any(axis=0)
    return np.flatnonzero(turning & ~bodies), np.flatnonzero(turning & bodies)


def _compensating(slopes: Array, drift: Array, velocity: Array, motors: Ints, damping: float) -> Array:
    """Return the velocities (k,) rad/s of k motors with which the angles to the target stay constant, by damped least squares.

    `slopes`: (2 cameras, n), derivatives of these angles (see `Gaze._angles`) by the motors. `drift`: (2 cameras,) rad/s, their
    change by the target's motion. `velocity`: (n,) rad/s, of all motors; the values of these k motors are ignored.
    """
    others, slope = velocity.copy(), slopes[:, motors]
    others[motors] = 0.0
    found = -np.linalg.solve(slope.T @ slope + damping * np.eye(len(motors)), slope.T @ (slopes @ others + drift))
    return np.asarray(found, dtype=np.float64)


def _seen(camera: Camera, transforms: Array, target: Array) -> Array:
    """Return a place in a camera's frame, (3,) m: right, down, ahead."""
    position, rotation = camera_frame(camera, transforms)
    seen: Array = rotation.T @ (target - position)
    return seen


def _angles_of(seen: Array) -> Array:
    """Return the angles (2,) rad by which a place in a camera's frame is to the right and below."""
    x, y, z = seen
    return np.array([np.arctan2(x, z), np.arctan2(y, np.hypot(x, z))])


def _angle_slope(seen: Array) -> Array:
    """Return the derivatives (2, 3) rad/m of the angles that `_angles_of` returns by the place `seen` (3,) m in a camera's frame."""
    x, y, z = seen
    flat = max(float(np.hypot(x, z)), 1e-9)
    square = flat * flat + y * y
    return np.array([[z / flat**2, 0.0, -x / flat**2], [-x * y / flat / square, flat / square, -y * z / flat / square]])
