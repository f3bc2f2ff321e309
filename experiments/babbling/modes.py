"""The three ways in which the same commands reach the robot, each a scenario for `mobee launch`."""

from __future__ import annotations

from pathlib import Path

from experiments.kit.live import TABLE as WORLD
from services.common.session import NAMESPACE

MODES = ("off", "one", "two")
TITLES = {"off": "without MoBeE", "one": "MoBeE 1.0", "two": "MoBeE 2.0"}
RATE = 50.0  # Hz, the published control period
FILTERED = "icub_filtered"  # namespace of the robot that MoBeE 1.0 offers
SPEED = 0.2  # of the motors' top speed, thesis 4.1.1

_ROBOT = """title = "Babbling {title}"

[shared]
mode = "lock"
patience = 20
robot = "icub"
world = {world}
seed = {seed}
{gains}

[services.robot_sim]
rate = {rate:g}
ticks = {ticks}
record = {record}
"""
_ONE = """participants = ["port_filter"]

[services.port_filter]
clients = "icub_filtered"
participants = ["babbler"]
"""
_TWO = """
[services.model]

[services.controller]
speed_scale = {speed:g}
"""
_BABBLER = """
[services.babbler]
module = "experiments.babbling.babbler"
at = "{at}"
robot_of = "{robot_of}"
speed = {speed:g}
run_dir = {folder}
"""


def scenario(mode: str, folder: Path, seed: int, ticks: int) -> str:
    """The scenario's text; what is measured goes to the folder."""
    where = _quoted(folder)
    gains = 'gains = "default"' if mode == "two" else ""
    at, robot_of = "goals" if mode == "two" else "drives", FILTERED if mode == "one" else NAMESPACE
    between = {"off": "", "one": _ONE, "two": _TWO.format(speed=SPEED)}[mode]
    robot = _ROBOT.format(title=TITLES[mode], gains=gains, seed=seed, rate=RATE, ticks=ticks, record=where, world=_quoted(WORLD))
    return robot + between + _BABBLER.format(at=at, robot_of=robot_of, speed=SPEED, folder=where)


def _quoted(path: Path) -> str:
    return '"' + str(path).replace("\\", "\\\\").replace('"', '\\"') + '"'
