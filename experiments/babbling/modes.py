"""The three ways in which the same commands reach the robot, each a scenario for `mobee launch`."""

from __future__ import annotations

from pathlib import Path

MODES = ("off", "one", "two")
TITLES = {"off": "without MoBeE", "one": "MoBeE 1.0", "two": "MoBeE 2.0"}
RATE = 50.0  # Hz, the published control period
SPEED = 0.2  # of the motors' top speed, thesis 4.1.1

_ROBOT = """title = "Babbling {title}"

[shared]
mode = "lock"
robot = "icub"
world = "table"
seed = {seed}
{gains}

[services.robot_sim]
rate = {rate:g}
ticks = {ticks}
record = {record}
"""
_BABBLER = """
[services.babbler]
module = "experiments.babbling.babbler"
at = "{at}"
ticks = {ticks}
speed = {speed:g}
run_dir = {folder}
"""
_TWO = """
[services.model]

[services.controller]
speed_scale = {speed:g}
"""


def scenario(mode: str, folder: Path, seed: int, minutes: float) -> str:
    """The scenario's text; what is measured goes to the folder."""
    ticks = round(60.0 * minutes * RATE)
    at = "goals" if mode == "two" else "drives"
    gains = 'gains = "default"' if mode == "two" else ""
    text = _ROBOT.format(title=TITLES[mode], gains=gains, seed=seed, rate=RATE, ticks=ticks, record=_quoted(folder))
    if mode == "two":
        text += _TWO.format(speed=SPEED)
    return text + _BABBLER.format(at=at, ticks=ticks, speed=SPEED, folder=_quoted(folder))


def _quoted(path: Path) -> str:
    return '"' + str(path).replace("\\", "\\\\").replace('"', '\\"') + '"'
