# SPDX-License-Identifier: Apache-2.0
"""Predicts the pixels of points that a robot's cameras see, with derivatives by the calibration's parameters and the posture."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from mobee.arrays import Array
from mobee.model.kinematics import link_transforms, point_jacobian
from mobee.robot.robot import Camera, Robot
from mobee.vision.imperfections import HEAD, CameraErrors
from mobee.vision.lens import Lens, camera_frames, into, mounted, right_slope, rotation_of, skew_of
from mobee.vision.tag import Tag

AXES = ("x", "y", "z", "turn_x", "turn_y", "turn_z")  # of a mount


@dataclass(frozen=True, slots=True, eq=False)
class Rig:
    """The cameras of a robot before calibration, and its tag.

    The property `names` has the names of the parameters that a calibration estimates, in their order. `cameras`: by name,
    with their poses in the kinematic model of the robot. `lens`: lens of all cameras. `tag`: the AprilTag on a palm; None: the robot has
    no tag.
    """

    robot: Robot
    cameras: Mapping[str, Camera]
    lens: Lens
    tag: Tag | None = None

    @property
    def head(self) -> tuple[int, ...]:
        """Indices of the head's motors, whose encoders may have offsets; empty for a robot without a head."""
        part = self.robot.parts.get(HEAD)
        return () if part is None else tuple(range(part.slice.start, part.slice.stop))

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the P parameters: mounts of the cameras (6 each), encoder offsets [rad], latency [s], and the tag's mount (6).

        A mount is the displacement [m] and the rotation vector [rad] by which a camera or the tag differs from the model, in the axes of
        its frame in the model.
        """
        mounts = [f"{camera}.{axis}" for camera in self.cameras for axis in AXES]
        return (*mounts, *(f"encoder.{self.robot.motors[motor]}" for motor in self.head), "latency", *(f"tag.{axis}" for axis in AXES))

    def where(self, group: str) -> slice:
        """Return the indices of the parameters of a group: the name of a camera, "encoder", "latency" or "tag"."""
        cameras, head = list(self.cameras), len(self.head)
        after = 6 * len(cameras)
        if group in self.cameras:
            start = 6 * cameras.index(group)
            return slice(start, start + 6)
        return {"encoder": slice(after, after + head), "latency": slice(after + head, after + head + 1)}.get(
            group, slice(after + head + 1, after + head + 7)
        )

    def errors(self, x: Array) -> CameraErrors:
        """Convert the calibration's parameters x (P,), in the order of `names` (m, rad and s), to CameraErrors."""
        encoders = np.zeros(len(self.robot.motors))
        encoders[list(self.head)] = x[self.where("encoder")]
        mounts = {camera: x[self.where(camera)] for camera in self.cameras}
        return CameraErrors(mounts, encoders, float(x[self.where("latency")][0]), x[self.where("tag")])

    def parameters(self, errors: CameraErrors) -> Array:
        """Convert CameraErrors to the calibration's parameters (P,), in the order of `names` (m, rad and s)."""
        x = np.zeros(len(self.names))
        for camera in self.cameras:
            x[self.where(camera)] = errors.mounts[camera]
        x[self.where("encoder")] = errors.encoders[list(self.head)]
        x[self.where("latency")], x[self.where("tag")] = errors.latency, errors.tag
        return x

    def deviations(self, kinds: Mapping[str, float]) -> Array:
        """Return the standard deviations (P,) of the calibration's parameters in its prior, in the order of `names`.

        `kinds`: the standard deviation of each kind of error, as `CameraSettings.deviations` returns them.
        """
        mount = [kinds["position"]] * 3 + [kinds["rotation"]] * 3
        tag = [kinds["tag_position"]] * 3 + [kinds["tag_rotation"]] * 3
        return np.array([*mount * len(self.cameras), *[kinds["encoder"]] * len(self.head), kinds["latency"], *tag])

    def posture(self, x: Array, q: Array, dq: Array) -> Array:
        """Return the true posture (..., n) rad at the exposure of a picture, according to parameters x (P,).

        `q` (..., n) rad and `dq` (..., n) rad/s: encoders and velocities at the time stamp of the picture. The parameters correct the
        latency and the encoder offsets.
        """
        errors = self.errors(x)
        return q - errors.latency * dq + errors.encoders


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """The predicted pixels of C points in each of K pictures of one camera, and their derivatives.

    Attributes:
        pixels: (K, C, 2), column and row.
        by_parameters: (K, C, 2, P), derivative by the calibration's parameters.
        by_posture: (K, C, 2, n) [px/rad].
        by_time: (K, C, 2) [px/s], for the given velocities of the motors.
        by_point: (K, C, 2, 3) [px/m], derivative by the position of the point in the root frame.
    """

    pixels: Array
    by_parameters: Array
    by_posture: Array
    by_time: Array
    by_point: Array


def see_points(rig: Rig, camera: str, x: Array, q: Array, dq: Array, points: Array) -> Seen:
    """Predict the pixels of points (K, C, 3) m, root frame, in K pictures of a camera.

    `x`: (P,) the calibration's parameters. `q` (K, n) rad and `dq` (K, n) rad/s: encoders and velocities at the time stamp of each picture.
    """
    transforms = link_transforms(rig.robot, rig.posture(x, q, dq))
    motion = np.zeros((*points.shape, len(rig.robot.motors)))
    return _seen(rig, camera, x, dq, transforms, points, motion)


def see_tag(rig: Rig, camera: str, x: Array, q: Array, dq: Array) -> Seen:
    """Predict the pixels of the four corners of the tag on the hand, in K pictures of a camera, in the order of `Tag.corners`.

    `x`: (P,) the calibration's parameters. `q` (K, n) rad and `dq` (K, n) rad/s: encoders and velocities at the time stamp of each picture.
    """
    assert rig.tag is not None
    transforms = link_transforms(rig.robot, rig.posture(x, q, dq))
    link, position, rotation = rig.tag.frame(rig.robot)
    mount = x[rig.where("tag")]
    centre, turned = mounted(position, rotation, mount)
    hand = transforms[:, link, :3, :]
    on_link = centre + rig.tag.corners @ turned.T  # (C, 3)
    points = np.einsum("kij,cj->kci", hand[..., :3], on_link) + hand[:, None, :, 3]
    motion = _moved(rig.robot, transforms, link, points)
    seen = _seen(rig, camera, x, dq, transforms, points, motion)
    axes = hand[..., :3] @ rotation  # (K, 3, 3)
    by_place = np.broadcast_to(axes[:, None], (*points.shape, 3))
    arms = -rotation_of(mount[3:]) @ skew_of(rig.tag.corners) @ right_slope(mount[3:])  # (C, 3, 3)
    by_turn = np.einsum("kij,cjl->kcil", axes, arms)
    by_tag = np.concatenate([by_place, by_turn], axis=-1)
    seen.by_parameters[..., rig.where("tag")] = seen.by_point @ by_tag
    return seen


def _seen(rig: Rig, camera: str, x: Array, dq: Array, transforms: Array, points: Array, motion: Array) -> Seen:
    """Predict pixels of points (K, C, 3), which move by `motion` (K, C, 3, n) [m/rad] with the motors."""
    mount = rig.cameras[camera]
    own = x[rig.where(camera)]
    position, rotation = camera_frames(mount, transforms, own)
    local = into(position[:, None], rotation[:, None], points)
    slope = rig.lens.projection_slope(local)  # (K, C, 2, 3)
    by_point = slope @ np.swapaxes(rotation, -1, -2)[:, None]
    by_posture = by_point @ (motion - _moved(rig.robot, transforms, mount.link, points))
    by_time = (by_posture @ dq[:, None, :, None])[..., 0]
    by_parameters = np.zeros((*local.shape[:-1], 2, len(rig.names)))
    turned = rotation_of(own[3:]).T
    by_parameters[..., rig.where(camera)] = np.concatenate(
        [np.broadcast_to(slope @ -turned, slope.shape), slope @ skew_of(local) @ right_slope(own[3:])], axis=-1
    )
    by_parameters[..., rig.where("encoder")] = by_posture[..., list(rig.head)]
    by_parameters[..., rig.where("latency")] = -by_time[..., None]
    return Seen(rig.lens.project(local), by_parameters, by_posture, by_time, by_point)


def _moved(robot: Robot, transforms: Array, link: int, points: Array) -> Array:
    """Return by how much points (K, C, 3) m that are fixed to a link move with the motors, (K, C, 3, n) [m/rad]."""
    each = [point_jacobian(robot, transforms, link, points[:, corner])[:, :3] for corner in range(points.shape[1])]
    return np.stack(each, axis=1)
