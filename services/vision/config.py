# SPDX-License-Identifier: Apache-2.0
"""Settings of the locator, which finds things in the pictures of two cameras."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta

from mobee.errors import InvalidValue
from mobee.model.world import World
from mobee.robot.robot import Robot
from mobee.vision.calibration.calibration import load_calibration
from mobee.vision.objects.detectors import require_detector
from mobee.vision.objects.thing import KINDS, Thing, things_in
from services.common.cameras import STEREO, CameraConfig, require_cameras
from services.common.worlds import world_around


class Config(CameraConfig, frozen=True, kw_only=True):
    """The settings of the locator, which finds things in the pictures of two cameras and publishes their positions.

    It uses the first two cameras. It looks for things with the shapes and colours of the targets in the world's file, at any position.
    """

    world: str = ""
    """Shipped world, path to a world file, or none; empty: the table for the shipped iCubs, none for every other robot."""
    detector: str = "color"
    """What finds things in a picture: color (their colours), a file of `mobee detector train`, or module:name of a function that returns a
    detector."""
    most: Annotated[int, Meta(ge=1, le=100)] = 1
    """Largest number of objects of each thing (kind of object) that get a name: NAME, NAME_2, ..."""
    calibration: str = ""
    """File of `mobee calibrate`; empty: cameras and encoders are assumed to have no errors."""
    encoder_noise: Annotated[float, Meta(ge=0, le=0.1)] = 0.0025
    """Standard deviation of one reading of an encoder, in rad. The covariance of a position depends on it."""
    valid_for: Annotated[float, Meta(gt=0, le=60)] = 5.0
    """Time after a picture for which the position in it may be used, in s of simulated time."""
    max_age: Annotated[float, Meta(gt=0, le=10)] = 0.3
    """Largest age of a picture at its arrival, in s of simulated time; older ones are not used."""
    blind_after: Annotated[float, Meta(gt=0, le=60)] = 1.0
    """Time without usable pictures after which all positions are withdrawn, in s of simulated time."""

    def load_world(self) -> World:
        """Return a new world in its initial state; raises MobeeError for a name or file that cannot be read."""
        return world_around(self.world, self.robot)

    def things(self) -> list[Thing]:
        """Return the things to look for: the coloured targets of the world.

        Raises InvalidValue if there is none, and MobeeError if the world cannot be read.
        """
        found = things_in(self.load_world())
        if not found:
            raise InvalidValue(
                f"vision has nothing to look for: the world has no target with a colour that is a {', '.join(KINDS[:-1])} or {KINDS[-1]}. "
                'Add one to its file, as <sphere name="ball" radius="0.03" role="target" color="0.9 0.05 0.05"/>, or leave the service out'
            )
        return found

    def check_robot(self, robot: Robot) -> None:
        """Raise MobeeError if the robot has fewer than two cameras, or if the world contains nothing to look for.

        It is also raised if the detector or the calibration cannot be used, or if a part's name cannot be used on the bus.
        """
        super().check_robot(robot)
        require_cameras(robot, self.cameras_on(robot), STEREO)
        require_detector(self.detector, self.things())
        if self.calibration:
            load_calibration(self.calibration).rig(robot, self.cameras_on(robot))
