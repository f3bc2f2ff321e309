"""The motion that shows a robot: each motor through its range in turn, then all together."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mobee.robot.robot import Array, Motor, Robot

RATE = 20.0  # poses a second
ALONE = 2.0  # s a motor
TOGETHER = 12.0  # s for all


@dataclass(frozen=True, slots=True)
class Stretch:
    """A stretch of the motion: what moves in it, and its poses (k, n) rad."""

    title: str
    poses: Array


def sweep(robot: Robot) -> list[Stretch]:
    """One stretch a motor, home -> minimum -> maximum -> home, then one in which all move at once; each begins and ends at home."""
    low, high = robot.limits.T
    home = np.clip(robot.home, low, high)
    stretches = []
    for index, motor in enumerate(robot.motor_table):
        poses = np.tile(home, (round(ALONE * RATE), 1))
        poses[:, index] = _there_and_back(len(poses), home[index], low[index], high[index])
        stretches.append(Stretch(f"{motor.name}: {_reach(robot, motor)}", poses))
    return [*stretches, Stretch("all motors", _together(round(TOGETHER * RATE), home, low, high))]


def _reach(robot: Robot, motor: Motor) -> str:
    """How far a motor moves its first joint."""
    if not motor.joints:
        return "moves no joint"
    index, scale, offset = motor.joints[0]
    low, high = np.sort(scale * motor.limits + offset)
    if robot.joints[index].kind == "prismatic":
        return f"{low:.3g} to {high:.3g} m"
    return f"{np.rad2deg(low):.4g} to {np.rad2deg(high):.4g} deg"


def _there_and_back(count: int, home: float, low: float, high: float) -> Array:
    """From home to low, to high and back, (count,) rad, at rest where it turns."""
    turns = np.array([home, low, high, home])
    share = np.linspace(0.0, 3.0, count)
    leg = np.minimum(share.astype(int), 2)
    smooth = 0.5 - 0.5 * np.cos(np.pi * (share - leg))
    return np.asarray(turns[leg] + smooth * (turns[leg + 1] - turns[leg]))


def _together(count: int, home: Array, low: Array, high: Array) -> Array:
    """Every motor swings between its limits at a pace of its own."""
    time = np.linspace(0.0, 1.0, count)[:, None]
    swings = 2 + np.arange(len(home)) % 3
    wave = np.sin(2.0 * np.pi * swings * time)
    return np.asarray(home + np.where(wave > 0, wave * (high - home), wave * (home - low)))
