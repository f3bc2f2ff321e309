"""The iCub of 2014, VirtualSkin's iCub, the Katana and the table world, as the files draw them."""

from __future__ import annotations

import warnings
from pathlib import Path

from mobee.errors import InvalidValue
from mobee.model.model import Model
from mobee.model.pose import Pose
from mobee.model.world import World
from mobee.model.world_file import load_world
from mobee.rendering.sheet import Panel, pictures_of, write_sheet
from mobee.rendering.solid import Solid, object_solids, robot_solids
from mobee.robot.load import load_robot
from mobee.robot.robot import Robot

ICUB, VIRTUAL_SKIN, WORLD = "2014-11-14_icub_9*.xml", "2011-07-21_icub_*.xml", "2014-11-14_world_*.xml"
FIELD = (0.35, 0.55, 0.85)
VEIL = 0.22  # opacity of a field
HEIGHT = 460  # pixels
OBLIQUE = (-40.0, 20.0)  # deg


def draw(files: Path, path: Path) -> Path:
    """Draw the files of a run; raises InvalidValue where one of them is missing."""
    icub, skin = _robot(files, ICUB), _robot(files, VIRTUAL_SKIN)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        world = load_world(_one(files, WORLD))
    panels = [
        _panel(icub, World(), "icub.xml, MoBeE 2014: solids and fields at home"),
        _panel(skin, World(), "icub.xml, VirtualSkin 2011: solids at home"),
        _panel(load_robot("katana"), World(), "the Katana of the thesis, appendix B"),
        _panel(icub, world, "world.xml, MoBeE 2014: table, target, cylinder"),
    ]
    return write_sheet([("", panels[:2]), ("", panels[2:])], path)


def _panel(robot: Robot, world: World, caption: str) -> Panel:
    pose = Model(robot, world).evaluate(robot.home)
    solids = [*robot_solids(pose), *object_solids(world.objects), *(_fields(pose) if not world.objects else [])]
    (picture,) = pictures_of([solids], OBLIQUE, HEIGHT)
    return Panel(picture, caption)


def _fields(pose: Pose) -> list[Solid]:
    """The fields of a robot, as glass; those that reach far below the robot are left out."""
    found = []
    for shape in pose.robot.shapes:
        if shape.role == "field" and max(shape.size) < 0.5:
            link = pose.transforms[shape.link]
            place, turn = link[:3, :3] @ shape.position + link[:3, 3], link[:3, :3] @ shape.rotation
            found.append(Solid(shape.kind, shape.size, place, turn, FIELD, VEIL, group=-3))
    return found


def _robot(files: Path, pattern: str) -> Robot:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return load_robot(_one(files, pattern))


def _one(files: Path, pattern: str) -> Path:
    found = sorted(files.glob(pattern))
    if not found:
        raise InvalidValue(f"{files} holds no {pattern}: run the experiment on all files first, without --only.")
    return found[0]
