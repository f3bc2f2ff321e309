"""A humanoid that learns by curiosity to plan and to reach, while a reactive layer keeps it safe."""

from mobee.collision import Contact, Geometry, World, WorldObject, box, capsule, cylinder, sphere
from mobee.errors import ActionInterrupted, InvalidValue, MobeeError, RobotFileError, UnknownName
from mobee.model import Model, Pose
from mobee.plant import Outcome, Plant
from mobee.robot.robot import Robot

__all__ = [
    "ActionInterrupted",
    "Contact",
    "Geometry",
    "InvalidValue",
    "MobeeError",
    "Model",
    "Outcome",
    "Plant",
    "Pose",
    "Robot",
    "RobotFileError",
    "UnknownName",
    "World",
    "WorldObject",
    "box",
    "capsule",
    "cylinder",
    "sphere",
]
