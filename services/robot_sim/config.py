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
from services.robot_sim.strength import with_torques

NotNegative = Annotated[float, Meta(ge=0)]


class Config(WorldConfig, frozen=True, kw_only=True):
    """The simulated robot's settings."""

    backend: Literal["auto", "pybullet", "mujoco", "kinematic"] = "auto"
    """Physics with contacts: PyBullet for the iCub or MuJoCo for every robot; kinematic: motor model alone; auto: an installed engine."""
    rate: Annotated[float, Meta(ge=1, le=1000)] = 100.0
    """Ticks a second."""
    speed: Annotated[float, Meta(gt=0, le=20)] = 1.0
    """Simulated seconds a second; a command's ttl stays in real time, its age is counted in ticks."""
    motors: Literal["published", "identified"] = "published"
    """The motors' numbers: those below, or those that were fitted to this robot, with which they do not count (docs/plant.md)."""
    lag: NotNegative = 0.05
    """Time constant of the motors, s."""
    delay: NotNegative = 0.02
    """Time before a command begins to act, s."""
    backlash: NotNegative = math.radians(0.2)
    """Play between motor and joint, rad."""
    friction: NotNegative = 0.0
    """Coulomb's, as the velocity that it costs, rad/s."""
    torques: Mapping[str, Annotated[float, Meta(gt=0)]] = {}
    """Largest torques of motors by pattern of their names, N m, in place of those of the robot's file, as { "?_thumb_*" = 0.3 }."""
    encoder_noise: NotNegative = math.radians(0.1)
    """Standard deviation of the encoders at a tick of 20 ms, rad; scaled with the tick."""
    substep: Annotated[float, Meta(gt=0)] = 0.005
    """Longest step of motors and physics, s."""
    jitter: Annotated[float, Meta(ge=0, le=0.1)] = 0.02
    """Standard deviation of a part's sampling time, share of a tick."""
    truth_rate: Annotated[float, Meta(gt=0, le=100)] = 20.0
    """Rate of the messages with the ground truth, per second."""
    participants: tuple[Annotated[str, Meta(pattern="^[a-z0-9_]+$")], ...] = ()
    """Lockstep: services that must be present before tick 1; the launcher names all services that affect the robot's motion."""
    ticks: Annotated[int, Meta(ge=0)] = 0
    """Lockstep: stop after so many ticks; 0: never."""
    stop_record: str = ""
    """File that holds the emergency stop, and into which programs of this machine write one; missing at the start: stopped; empty: none."""
    record: str = ""
    """Folder to which every tick is written as it was, for experiments (services.robot_sim.watch); empty: none."""

    def packages(self) -> Mapping[str, str]:
        """See ServiceConfig; returns the packages of a back-end that is chosen by name."""
        return {} if self.backend == "auto" else dict.fromkeys(PACKAGES[self.backend], EXTRA)

    def check_robot(self, robot: Robot) -> None:
        """Check also that the back-end can move the robot, and that identified motor parameters exist for it; raises MobeeError."""
        super().check_robot(robot)
        choose(self.backend, robot)
        with_torques(robot, self.torques)
        if self.motors == "identified":
            MotorParameters.identified(robot.name)


class RendererConfig(WorldConfig, frozen=True, kw_only=True):
    """The renderer's settings."""

    cameras: tuple[str, ...] = ()
    """Cameras beside the first two of the robot, as of vision."""
    frame_rate: Annotated[float, Meta(gt=0, le=30)] = 5.0
    """Pictures of each camera a second of simulated time."""
    width: Annotated[int, Meta(ge=16, le=1280)] = 320
    """Columns of a picture."""
    height: Annotated[int, Meta(ge=16, le=1024)] = 240
    """Rows of a picture."""
    optics: Literal["ideal", "dragonfly"] = "ideal"
    """ideal: pictures of the posture that the encoders report; dragonfly: of the simulator's true posture, by cameras with distortion,
    noise, motion blur, latency, and mounting errors drawn by the seed, in a room (docs/vision.md).  Needs robot_sim's truth_rate = 100."""
    samples: Annotated[int, Meta(ge=1, le=16)] = 2
    """dragonfly: moments of the exposure at which the scene is drawn; a picture takes as many times as long."""
    tag: str = ""
    """Marker on which a tag is drawn, for `mobee calibrate`; empty: none."""

    def check_robot(self, robot: Robot) -> None:
        """Check also that the robot has a camera; raises MobeeError."""
        super().check_robot(robot)
        require_cameras(robot, cameras_of(robot, self.cameras), 1)
        if self.tag:
            robot.marker(self.tag)
        if self.optics == "dragonfly" and (self.width, self.height) != (320, 240):
            raise InvalidValue(f'optics = "dragonfly" makes pictures of 320 x 240 pixels, not of {self.width} x {self.height}')
