# SPDX-License-Identifier: Apache-2.0
"""Chooses the agents of a robot: the published agents for the iCub at its table; for any other robot, agents derived from its file."""

from __future__ import annotations

import argparse
import os
import re
import warnings
from collections.abc import Iterator, Sequence, Sized
from dataclasses import dataclass
from typing import Any

from mobee.arrays import checked_seed
from mobee.control.gains import Gains
from mobee.derivation import Arm, Derived, derive
from mobee.errors import InvalidValue
from mobee.learning.explorers import EXPLORERS
from mobee.robot.cameras import cameras_of, key_of
from mobee.robot.load import load_robot
from mobee.robot.robot import Robot
from mobee.settings import named
from mobee.vision.objects.thing import things_in
from mobee_cli.robot_options import urdf_options
from services.agents.config import Config as AgentConfig
from services.common.cameras import STEREO
from services.common.worlds import effective_world, world_around

WIDTH = 80  # columns
LONGEST_NAME = 64  # characters of a robot's name that files and folders are named by: file systems allow 255 bytes
ICUB = "icub"
PUBLISHED = ("torso", "left_arm", "right_arm")  # the parts that learn in thesis 7.4


@dataclass(frozen=True, slots=True, eq=False)
class Setup:
    """A robot and its agents.

    `name`: name for files and titles. `shipped`: name of the shipped robot; empty: the robot is written to a file of its own. `world`: name
    or path of the world, or "none". `gains`: name of the gains of the control law, as `Gains.named` takes it. `agents`: settings of each
    agent, by part. `lines`: lines of text that describe the robot and its agents to the user. `cameras`: texts of the options --camera, for
    cameras in addition to those in the robot's file. `eyes`: names of the services for cameras, "renderer" and "vision", that the live
    system needs.
    """

    name: str
    shipped: str
    robot: Robot
    world: str
    gains: str
    agents: dict[str, AgentConfig]
    lines: tuple[str, ...]
    cameras: tuple[str, ...] = ()
    eyes: tuple[str, ...] = ()

    @property
    def law(self) -> Gains:
        """The gains of the control law, looked up by the name in the attribute `gains`: "default", "derived" or "published_2014".

        Raises UnknownName if there is no such name.
        """
        return Gains.named(self.gains)


def add_setup_options(parser: argparse.ArgumentParser) -> None:
    """Add the options that choose the agents to a parser: --part, --explorer and --seed."""
    text = "motors that a part learns with, for example arm=joint1,joint2,joint4; may be repeated (default: derived)"
    parser.add_argument("--part", dest="parts", action="append", default=[], metavar="PART=M1,M2", help=text)
    parser.add_argument("--explorer", metavar="NAME", help="how the agents choose actions (default: curious)")
    parser.add_argument("--seed", type=int, metavar="N", help="seed of all random draws (default: 0)")


def setup_of(arguments: argparse.Namespace, robot: str) -> Setup:
    """Return the setup of agents for a robot.

    `arguments`: the options of the command. `robot`: name or path of the robot, as `mobee.load_robot` takes it. Raises MobeeError if the
    setup cannot be made.
    """
    options = {name: value for name, value in urdf_options(arguments).items() if value is not None}
    parts = _parts(arguments.parts)
    seed = 0 if arguments.seed is None else checked_seed(arguments.seed)
    explorer = "curious" if arguments.explorer is None else arguments.explorer
    named("explorer", explorer, EXPLORERS)  # an unknown one is refused before a file is written
    common: dict[str, Any] = {"explorer": explorer, "seed": seed}
    world = effective_world(arguments.world, robot)
    asked = tuple(getattr(arguments, "cameras", ()))  # `mobee learn` has no such option
    if robot == ICUB and not parts and not options:
        agents = {part: AgentConfig(part=part, **common) for part in PUBLISHED}
        icub = load_robot(ICUB)
        eyes = _eyes(cameras_of(icub, asked), world, ICUB) if asked else ()
        return Setup(ICUB, ICUB, icub, world, "published_2014", agents, _PUBLISHED_LINES, asked, eyes)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        loaded = load_robot(robot, **options)
    derived = derive(loaded, parts, seed)
    agents = {
        arm.part: AgentConfig(part=arm.part, joints=arm.joints, rest=derived.rest(arm), neighbours=_neighbours(derived, arm), **common)
        for arm in derived.arms
    }
    gains = "default" if derived.gains == Gains.default() else "derived"
    remarks = [str(one.message).rpartition(":1: ")[2] for one in caught]
    name = key_of(loaded.name, "robot")[:LONGEST_NAME]
    cameras = cameras_of(derived.robot, asked)
    eyes, lines = _eyes(cameras, world, name), tuple(_described(derived, remarks, list(cameras)))
    return Setup(name, "", derived.robot, world, gains, agents, lines, asked, eyes)


def _eyes(cameras: Sized, world: str, robot: str) -> tuple[str, ...]:
    """Return the names of the services that the cameras need, none without cameras.

    They are "renderer", and also "vision", which locates things, if two or more cameras and a thing to locate exist. Raises MobeeError if
    the world cannot be read.
    """
    things = things_in(world_around(world, robot))
    return ("renderer",) * bool(cameras) + ("vision",) * (len(cameras) >= STEREO and bool(things))


_PUBLISHED_LINES = (
    "icub: 41 motors; torso, left_arm and right_arm learn, as in thesis 7.4",
    "  the joints of each are at 3 levels: 27 states of the torso, 81 of an arm",
)


def _neighbours(derived: Derived, arm: Arm) -> int:
    space = derived.space(arm)
    return int(space.goals.shape[1])


def _parts(texts: list[str]) -> dict[str, tuple[str, ...]]:
    """Return the motors of each part in the options; raises InvalidValue."""
    parts: dict[str, tuple[str, ...]] = {}
    for text in texts:
        name, equals, motors = text.partition("=")
        listed = tuple(filter(None, motors.split(",")))
        if name in parts:
            raise InvalidValue(f"--part {text}: {name} is given twice. Give all its motors in one --part.")
        if not equals or not listed or not re.fullmatch(r"[a-z0-9_]+", name):
            raise InvalidValue(f"--part {text}: give a name of a-z, 0-9 and _ and its motors, as --part arm=joint1,joint2.")
        parts[name] = listed
    return parts


def _described(derived: Derived, remarks: Sequence[str], cameras: Sequence[str]) -> Iterator[str]:
    """Yield lines that describe a derived robot to the user: a robot whose arms, limits and fields were derived from its file.

    There are at most nine lines, and one more for each arm, each of at most WIDTH columns.
    """
    robot = derived.robot
    motors, parts, shapes = (_counted(len(robot.motors), "motor"), _counted(len(robot.parts), "part"), _counted(len(robot.shapes), "shape"))
    yield _cut(f"{robot.name}: {motors} in {parts}, {shapes}")
    for remark in remarks[:2]:
        yield _cut(f"  note   {remark}")
    for arm in derived.arms:
        yield _cut(f"  learns {arm.part}: {len(derived.space(arm))} states of {_listed(arm.joints)}")
    if cameras:
        yield _cut(f"  cameras {', '.join(cameras)}")
    if derived.limited:
        yield _cut(f"  limits half a turn to each side: {_listed(derived.limited)}")
    if derived.home_moved:
        yield _cut(f"  home   moved away from contact: {_listed(derived.home_moved)}")
    if derived.narrowed:
        yield _cut(f"  ranges narrower, as solids touch beyond: {_listed(derived.narrowed)}")
    if derived.left_out:
        pairs = ", ".join(f"{one}/{other}" for one, other in derived.left_out)
        yield _cut(f"  pairs  {len(derived.left_out)} not tested, as they touch in most poses: {pairs}")
    if derived.field:
        clauses = f", {_counted(len(robot.clauses), 'clause')}" if robot.clauses else ""
        yield _cut(f"  fields {1e3 * derived.field:.0f} mm wide, {_counted(len(robot.field_pairs), 'pair')}{clauses}")


def _counted(number: int, thing: str) -> str:
    return f"{number} {thing}" if number == 1 else f"{number} {thing}s"


def _listed(names: Sequence[str]) -> str:
    """Return names, their common beginning only once: "panda_joint1, 2, 3"."""
    start = len(os.path.commonprefix(names)) if len(names) > 1 else 0
    return ", ".join([names[0], *(name[start:] or name for name in names[1:])])


def _cut(text: str) -> str:
    return text if len(text) <= WIDTH else f"{text[: WIDTH - 4]} ..."
