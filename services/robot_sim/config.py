# SPDX-License-Identifier: Apache-2.0
"""Settings of robot_sim and of the renderer."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Literal

from msgspec import Meta

from mobee.errors import InvalidValue
from mobee.robot.cameras import cameras_of
from mobee.robot.robot import Robot
from mobee.simulation.motors import MotorParameters
from services.common.cameras import require_cameras
from services.common.config import WorldConfig
from services.robot_sim.choice import EXTRA, PACKAGES, choose
from services.robot_sim.sensors import errors_of
from services.robot_sim.strength import with_torques

NotNegative = Annotated[float, Meta(ge=0)]


class Config(WorldConfig, frozen=True, kw_only=True):
    """The simulated robot's settings."""

    backend: Literal["auto", "pybullet", "mujoco", "kinematic"] = "auto"
    """What moves the robot. pybullet: physics with contacts, for the iCub; mujoco: physics with contacts, for every robot; kinematic: the
    motor model alone; auto: an installed physics engine."""
    rate: Annotated[float, Meta(ge=1, le=1000)] = 100.0
    """Ticks per second of simulated time."""
    speed: Annotated[float, Meta(gt=0, le=20)] = 1.0
    """Simulated seconds per second of real time. The ttl of a command stays in real time, its age is counted in ticks."""
    motors: Literal["published", "identified"] = "published"
    """The parameters of the motors. published: the settings below; identified: parameters that were fitted to this robot, instead of lag,
    delay, backlash, friction and encoder_noise (docs/plant.md)."""
    lag: NotNegative = 0.05
    """Time constant of the motors, s."""
    delay: Annotated[float, Meta(ge=0, le=10)] = 0.02
    """Time from a command to its first effect on the motor, s."""
    backlash: NotNegative = math.radians(0.2)
    """Play between motor and joint, rad."""
    friction: NotNegative = 0.0
    """Coulomb friction of the motors, as the velocity that it costs, rad/s."""
    torques: Mapping[str, Annotated[float, Meta(gt=0)]] = {}
    """Largest torques of motors, N m, instead of those in the robot's file, by patterns of motor names, as { "?_thumb_*" = 0.3 }."""
    encoder_noise: NotNegative = math.radians(0.1)
    """Standard deviation of the noise of the encoders at a tick of 20 ms, rad; at another tick dt it is larger by the factor sqrt(20 ms /
    dt)."""
    encoder_errors: Mapping[str, float] = {}
    """Constant errors of encoders (reading minus true position), rad, or m for motors that slide, by motor, as { r_elbow = 0.05 }: the
    robot is miscalibrated. Motors that are not named have no error."""
    substep: Annotated[float, Meta(ge=1e-5)] = 0.005
    """Longest time step of motors and physics, s."""
    jitter: Annotated[float, Meta(ge=0, le=0.1)] = 0.02
    """Standard deviation of a part's sampling time, as a share of a tick."""
    truth_rate: Annotated[float, Meta(gt=0, le=100)] = 20.0
    """Number of messages with the ground truth per second of simulated time."""
    participants: tuple[Annotated[str, Meta(pattern="^[a-z0-9_]+$")], ...] = ()
    """Lockstep: services that must be present before tick 1. The launcher names all services that affect the robot's motion."""
    ticks: Annotated[int, Meta(ge=0)] = 0
    """Lockstep: number of ticks after which the run stops; 0: it does not stop."""
    stop_record: str = ""
    """File that records the emergency stop, and into which programs of this machine write a stop. If it is missing at the start, the robot
    is stopped. Empty: no file."""
    stop_address: Annotated[str, Meta(pattern="^(.+:[0-9]+)?$")] = ""
    """UDP address HOST:PORT at which programs of other machines stop the robot without the router. Empty: none."""
    record: str = ""
    """Folder into which the true joint positions and the contacts of every tick are written, for experiments (services.robot_sim.watch);
    empty: none."""

    def packages(self) -> Mapping[str, str]:
        """Return the Python packages that the back-end needs; empty if `backend` is "auto".

        Keys: import names of the packages. Values: the extra of this project that installs the package.
        """
        return {} if self.backend == "auto" else dict.fromkeys(PACKAGES[self.backend], EXTRA)

    def check_robot(self, robot: Robot) -> None:
        """Raise MobeeError if the back-end cannot move the robot, a setting does not fit it, or a part's name cannot be used on the bus.

        If the setting `motors` is "identified", fitted motor parameters of this robot must exist. Each pattern of `torques` must match a
        motor. Each name in `encoder_errors` must be a motor, and each error must be finite.
        """
        super().check_robot(robot)
        errors_of(robot, self.encoder_errors)
        choose(self.backend, robot)
        with_torques(robot, self.torques)
        if self.motors == "identified":
            MotorParameters.identified(robot.name)


class RendererConfig(WorldConfig, frozen=True, kw_only=True):
    """The renderer's settings."""

    cameras: tuple[str, ...] = ()
    """Further cameras, beside the first two of the robot's file; each as in `services.common.cameras.CameraConfig.cameras`, for example
    NAME, the name of a camera in the file, a link or a marker."""
    frame_rate: Annotated[float, Meta(gt=0, le=30)] = 5.0
    """Number of pictures of each camera per second of simulated time."""
    width: Annotated[int, Meta(ge=16, le=1280)] = 320
    """Columns of a picture."""
    height: Annotated[int, Meta(ge=16, le=1024)] = 240
    """Rows of a picture."""
    optics: Literal["ideal", "dragonfly"] = "ideal"
    """ideal: pictures of the posture that the encoders report. dragonfly: pictures of the simulator's true posture in a room, by cameras
    with distortion, noise, motion blur, latency, and mounting errors that are drawn with the seed (docs/vision.md); this needs truth_rate =
    100 in robot_sim."""
    samples: Annotated[int, Meta(ge=1, le=16)] = 2
    """dragonfly: number of moments of an exposure at which the scene is drawn. The time for a picture is proportional to it."""
    tag: str = ""
    """Marker on which a tag is drawn, for `mobee calibrate`; empty: none."""

    def check_robot(self, robot: Robot) -> None:
        """Raise MobeeError if the robot has no camera, or if a part's name cannot be used on the bus.

        It is also raised if the setting `tag` is not empty and names no marker of the robot, or if `optics` is "dragonfly" and the pictures
        do not have 320 x 240 pixels.
        """
        super().check_robot(robot)
        require_cameras(robot, cameras_of(robot, self.cameras), 1)
        if self.tag:
            robot.marker(self.tag)
        if self.optics == "dragonfly" and (self.width, self.height) != (320, 240):
            raise InvalidValue(f'optics = "dragonfly" makes pictures of 320 x 240 pixels, not of {self.width} x {self.height}')
