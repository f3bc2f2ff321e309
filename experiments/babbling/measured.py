"""One trial, measured: what is kept of it when its record of every tick is thrown away."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import msgspec
import numpy as np
from msgspec import Struct

from experiments.babbling.command_log import COMMANDS, Commanded, Ending, read_commands
from experiments.babbling.contacts import Touch, read_touches
from experiments.babbling.motion import beyond_limits, jerk, path_length, speed
from experiments.babbling.moved import moved_motors
from mobee.robot.robot import Array, Robot

REACHED = float(np.deg2rad(10.0))  # rad, of every motor of a part: the limits' own zone, less than half a cell of the thesis' lattices
RETURNED = float(np.deg2rad(5.0))  # rad, likewise
POSITIONS, CONTACTS = "q.f64", "contacts.csv"  # as services.robot_sim.record writes them
SUMMARY = "summary.json"  # of the launcher

Outcome = Literal["completed", "deflected", "returned"]


class Judged(Struct, frozen=True):
    """A command and what became of it."""

    outcomes: dict[str, Outcome]  # by part
    endings: dict[str, Ending]  # by part
    left: dict[str, float]  # by part: rad, how far its worst motor ended from where it should
    duration: float  # s
    path: float  # rad, all motors together
    way: float  # rad, the straight way from begin to target, all motors together


class Lockstep(Struct, frozen=True):
    """What the launcher says of the run's ticks."""

    ticks: int
    speed: float  # x real time
    repeatable: bool  # everybody answered every tick in time
    states_sha256: str  # of the state stream


class _Summary(Struct):
    """What is used of the launcher's summary."""

    lockstep: Lockstep


class Trial(Struct, frozen=True):
    """The numbers of one trial."""

    seconds: float  # robot time
    commands: list[Judged]
    touches: list[Touch]
    beyond: float  # rad, the furthest beyond a limit; negative: inside
    motor: str  # that went there
    speed_squared: float  # (rad/s)^2, mean over ticks and motors
    jerk_squared: float  # (rad/s^3)^2, mean over ticks and motors
    jerk_max: float  # rad/s^3
    path: float  # rad
    lockstep: Lockstep


def measure(folder: Path, robot: Robot, dt: float) -> Trial:
    """What a finished trial left in its folder."""
    q_all = np.fromfile(folder / POSITIONS).reshape(-1, len(robot.motors))
    moved = moved_motors(robot)
    q = q_all[:, moved]
    worst = beyond_limits(q, robot.limits[moved])
    third = jerk(q, dt)
    return Trial(
        seconds=len(q) * dt,
        commands=[judge(commanded, q_all, robot, dt) for commanded in read_commands(folder / COMMANDS)],
        touches=read_touches(folder / CONTACTS, dt),
        beyond=float(worst.max()),
        motor=robot.motors[moved[int(worst.argmax())]],
        speed_squared=float((speed(q, dt) ** 2).mean()),
        jerk_squared=float((third**2).mean()),
        jerk_max=float(np.abs(third).max()),
        path=path_length(q),
        lockstep=msgspec.json.decode((folder / SUMMARY).read_bytes(), type=_Summary).lockstep,
    )


def judge(commanded: Commanded, q_all: Array, robot: Robot, dt: float) -> Judged:
    """Where the parts ended; q_all (ticks, n) rad at the ends of the ticks, the first is tick 1."""
    moved = moved_motors(robot)
    target = np.array(commanded.target)
    course = q_all[max(commanded.begin - 2, 0) : max(commanded.end - 1, 1)]  # from the beginning of tick `begin` to that of `end`
    first, last = course[0], course[-1]
    own = {name: moved[(moved >= part.slice.start) & (moved < part.slice.stop)] for name, part in robot.parts.items()}
    left = {name: float(np.abs(last - target)[motors].max()) for name, motors in own.items()}
    return Judged(
        outcomes={name: _outcome(left[name], float(np.abs(last - first)[motors].max())) for name, motors in own.items()},
        endings=commanded.endings,
        left=left,
        duration=(commanded.end - commanded.begin) * dt,
        path=path_length(course[:, moved]),
        way=float(np.abs(target - first)[moved].sum()),
    )


def _outcome(left: float, gone: float) -> Outcome:
    """From how far a part ended from its target, and from where it began, rad."""
    if left <= REACHED:
        return "completed"
    return "returned" if gone <= RETURNED else "deflected"


def write_trial(path: Path, trial: Trial) -> None:
    """Write it whole or not at all."""
    new = path.with_suffix(".new")
    new.write_bytes(msgspec.json.format(msgspec.json.encode(trial), indent=1))
    new.replace(path)


def read_trial(path: Path) -> Trial:
    """What `write_trial` wrote."""
    return msgspec.json.decode(path.read_bytes(), type=Trial)
