# SPDX-License-Identifier: Apache-2.0
"""One trial of `babbling`: random commands, a new live system in lockstep that executes them, and the measurements."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Literal, TextIO

import numpy as np
from msgspec import Struct

from experiments.kit.live.launch import PHYSICS, TABLE, summary_of
from experiments.kit.live.system import CONTACTS, POSITIONS, Touch, read_positions, read_touches
from experiments.kit.run_folder import decoded, encoded
from mobee.arrays import Array
from mobee.errors import MobeeError
from mobee.robot.robot import Robot
from services.common.session import NAMESPACE

ROBOT = "icub"
HANDS = ("hand", "thumb", "index", "middle", "pinky")  # in the names of the motors that do not move
COUNT = 23  # thesis 4.1.1: "all joints on the iCub upper-body except those in the hands"
PEAK = 1.875  # peak over mean speed of a minimum-jerk motion
COMMANDS = "commands.jsonl"
Ending = Literal["over", "settled", "timeout", "refused"]  # over: its time has passed; refused: ended by the safety layer


def moved_motors(robot: Robot) -> Array:
    """Return the indices of the 23 motors that babble: 3 of the torso, 6 of head and eyes, and 7 of each arm."""
    return np.array([i for i, name in enumerate(robot.motors) if not any(word in name for word in HANDS)])


class Targets:
    """A sequence of random postures, uniform over the whole ranges of the 23 motors, with the hands at home.

    Equal seeds give equal sequences.
    """

    def __init__(self, robot: Robot, seed: int) -> None:
        self._rng = np.random.default_rng([seed, 0xBABB1E])
        self._moved = moved_motors(robot)
        self._home, self._limits = robot.home, robot.limits[self._moved]

    def next(self) -> Array:
        """Return the next posture of all motors, (n,) rad."""
        q = self._home.copy()
        q[self._moved] = self._rng.uniform(self._limits[:, 0], self._limits[:, 1])
        return q


class PositionMove:
    """A minimum-jerk motion of all motors from rest to rest.  `duration`: time until the last motor arrives [s]."""

    def __init__(self, start: Array, target: Array, speed: Array) -> None:
        """`start`, `target`: positions (n,) rad.  `speed`: (n,) rad/s, the largest speed of each motor."""
        self._start, self._distance = start, target - start
        self._durations = PEAK * np.abs(self._distance) / speed
        self.duration = float(self._durations.max())  # s

    def at(self, t: float) -> Array:
        """Return the reference positions (n,) rad at time `t` [s] after the start; after the end, the target."""
        share = np.divide(t, self._durations, out=np.ones_like(self._durations), where=self._durations > 0.0).clip(0.0, 1.0)
        smooth = share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
        position: Array = self._start + smooth * self._distance
        return position


class Commanded(Struct, frozen=True, forbid_unknown_fields=True):
    """A posture that was commanded to all parts at once, and how this command ended.

    `begin`: tick of the command.  `end`: tick at which its outcome is judged.  `target`: positions of all motors [rad].  `endings`: how the
    command ended, by part; without MoBeE and with MoBeE 1.0: "over" (the time of the move has passed) or "refused" (ended by the safety
    layer); with MoBeE 2.0: "settled" or "timeout" (as the controller reports), or "refused" (another end).
    """

    begin: int
    end: int
    target: list[float]
    endings: dict[str, Ending]


class CommandLog:
    """A file of commands, one JSON text per line; each command is on disk when `note` returns."""

    def __init__(self, path: Path) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        self._file: TextIO = path.open("w", buffering=1)

    def note(self, commanded: Commanded) -> None:
        """Append a command that has ended to the file of commands."""
        self._file.write(encoded(commanded) + "\n")


def read_commands(path: Path) -> list[Commanded]:
    """Read all commands that `CommandLog` wrote to a file; an incomplete last line is ignored."""
    *whole, _ = path.read_text().split("\n")
    return [decoded(line, Commanded) for line in whole]


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
backend = "{backend}"
rate = {rate:g}
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
module = "experiments.claims.ch4_reflex.babbler"
at = "{at}"
robot_of = "{robot_of}"
speed = {speed:g}
run_dir = {folder}
"""
START_TIMEOUT = 60.0  # s until the first tick
TICK_TIMEOUT = 30.0  # s without a tick after which a trial has failed
REACHED = float(np.deg2rad(10.0))  # rad, of every motor of a part: the zone of the limits; less than half a lattice cell
RETURNED = float(np.deg2rad(5.0))  # rad, of every motor of a part
SUMMARY = "summary.json"  # of the launcher

Outcome = Literal["completed", "deflected", "returned"]


def scenario(mode: str, folder: Path, seed: int, backend: str = PHYSICS[0]) -> str:
    """Return the text of a scenario (the file that lists the system's processes and settings) for one trial.

    `folder`: the system writes its recordings into it.  `mode`: "off" (without MoBeE), "one" (MoBeE 1.0) or "two" (MoBeE 2.0).  `backend`:
    physics engine of the robot.  `seed`: of the run.
    """
    where = _quoted(folder)
    gains = 'gains = "default"' if mode == "two" else ""
    at, robot_of = "goals" if mode == "two" else "drives", FILTERED if mode == "one" else NAMESPACE
    between = {"off": "", "one": _ONE, "two": _TWO.format(speed=SPEED)}[mode]
    values = {"title": TITLES[mode], "gains": gains, "seed": seed, "rate": RATE, "record": where, "backend": backend}
    robot = _ROBOT.format(world=_quoted(TABLE), **values)
    return robot + between + _BABBLER.format(at=at, robot_of=robot_of, speed=SPEED, folder=where)


def _quoted(path: Path) -> str:
    return '"' + str(path).replace("\\", "\\\\").replace('"', '\\"') + '"'


class TrialFailed(MobeeError):
    """Raised when a trial fails; the message says where its logs are."""


def run_trial(
    folder: Path, mode: str, robot: Robot, seed: int, ticks: int, show: Callable[[float], None], backend: str = PHYSICS[0]
) -> None:
    """Run a trial of `ticks` ticks, and write commands, positions, contacts and the summary of the run into `folder`.

    `mode`: "off" (without MoBeE), "one" (MoBeE 1.0) or "two" (MoBeE 2.0).  `seed`: of the random postures and the simulated robot.  `show`:
    function that is called with the finished share in [0, 1].  `backend`: physics engine.  Raises TrialFailed if the ticks stop or the
    system ends early, and LaunchFailed if it does not start.
    """
    folder.mkdir(parents=True, exist_ok=True)
    for left in (COMMANDS, POSITIONS):  # of an interrupted trial
        (folder / left).unlink(missing_ok=True)
    file = folder / f"{mode}.toml"
    file.write_text(scenario(mode, folder.resolve(), seed, backend))
    due = ticks * 8 * len(robot.motors)  # bytes of a whole record
    written, deadline = 0, time.monotonic() + START_TIMEOUT

    def watch(_: int) -> None:
        nonlocal written, deadline
        size = _size(folder / POSITIONS)
        if size != written:
            written, deadline = size, time.monotonic() + TICK_TIMEOUT
            show(size / due)
        elif time.monotonic() > deadline:
            raise TrialFailed(f"{mode}: no tick for {TICK_TIMEOUT:g} s; see {folder / 'launch'}")

    summary = summary_of(str(file), ticks=ticks, runs=folder / "launch", watch=watch)
    (folder / SUMMARY).write_text(encoded(summary))
    if _size(folder / POSITIONS) != due:
        raise TrialFailed(f"{mode}: the system ended before its time; see {folder / 'launch'}")


def _size(path: Path) -> int:
    return path.stat().st_size if path.exists() else 0


class Judged(Struct, frozen=True):
    """The outcome of a posture that was commanded to all parts at once.

    `outcomes`: by part; "completed": all motors of the part ended within 10 degrees of the target; "returned": they did not, and ended
    within 5 degrees of the start; "deflected": neither.  `endings`: how the command ended, by part, as in `Commanded`.  `left`: by part,
    the largest remaining error of a motor [rad].  `duration`: from the command to the tick at which it is judged [s].  `path`: length of
    the path of each motor, summed over the 23 motors that babble [rad].  `way`: this sum for the straight path from the start to the target
    [rad].
    """

    outcomes: dict[str, Outcome]
    endings: dict[str, Ending]
    left: dict[str, float]
    duration: float
    path: float
    way: float


class Lockstep(Struct, frozen=True):
    """The part of the launcher's summary about lockstep, in which every tick waits for the answers of all processes.

    `ticks`: number of ticks.  `speed`: in multiples of real time.  `repeatable`: whether all processes answered every tick in time.
    `states_sha256`: SHA-256 hash of the states of all parts in all ticks: q, dq, mode, and state of the gate (the check of commands before
    the motors).
    """

    ticks: int
    speed: float
    repeatable: bool
    states_sha256: str


class _Summary(Struct):
    """The part of the launcher's summary that is used."""

    lockstep: Lockstep


class Trial(Struct, frozen=True):
    """The measurements of one trial; motors are only the 23 that babble (torso, head and arms without hands).

    `seconds`: robot time [s].  `commands`: outcomes of all commands.  `touches`: contacts of solids.  `beyond`: largest distance of a motor
    beyond a limit [rad], negative inside; `motor`: its name.  `speed_squared` and `jerk_squared`: means over ticks and motors, in (rad/s)^2
    and (rad/s^3)^2.  `jerk_max`: [rad/s^3].  `path`: length of the motors' paths, summed [rad].  `lockstep`: ticks, speed and repeatability
    of the run.
    """

    seconds: float
    commands: list[Judged]
    touches: list[Touch]
    beyond: float
    motor: str
    speed_squared: float
    jerk_squared: float
    jerk_max: float
    path: float
    lockstep: Lockstep


def measure(folder: Path, robot: Robot, dt: float) -> Trial:
    """Compute the measurements of a finished trial from the files in its folder.  `dt`: duration of a tick [s]."""
    q_all = read_positions(folder, robot)
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
        lockstep=decoded((folder / SUMMARY).read_text(), _Summary).lockstep,
    )


def judge(commanded: Commanded, q_all: Array, robot: Robot, dt: float) -> Judged:
    """Return the outcome of a command.

    `q_all`: (ticks, n) rad, positions of the motors at the ends of the ticks; row 0 is tick 1.  `dt`: duration of a tick [s].
    """
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
    """Return the outcome of a command for one part of the robot, such as an arm.

    `left`: largest distance of a motor from its target at the end of the command [rad].  `gone`: largest distance of a motor from its
    start [rad].  The outcome is "completed" if `left` is at most 10 degrees, else "returned" if `gone` is at most 5 degrees, else
    "deflected".
    """
    if left <= REACHED:
        return "completed"
    return "returned" if gone <= RETURNED else "deflected"


def write_trial(path: Path, trial: Trial) -> None:
    """Write the measurements of a trial to a file.  An interruption leaves no incomplete file."""
    new = path.with_suffix(".new")
    new.write_text(encoded(trial, indent=1))
    new.replace(path)


def read_trial(path: Path) -> Trial:
    """Read the measurements of a trial from a file that `write_trial` wrote."""
    return decoded(path.read_text(), Trial)


def beyond_limits(q: Array, limits: Array) -> Array:
    """Return the largest distance of each motor beyond its limits, (m,) rad; negative for a motor that stays inside.

    `q`: (ticks, m) rad.  `limits`: (m, 2) rad, lower and upper.
    """
    worst: Array = np.maximum(limits[:, 0] - q.min(axis=0), q.max(axis=0) - limits[:, 1])
    return worst


def path_length(q: Array) -> float:
    """Return the length of the path [rad], summed over all motors.  `q`: positions (ticks, m) rad."""
    return float(np.abs(np.diff(q, axis=0)).sum())


def speed(q: Array, dt: float) -> Array:
    """Return the velocities (ticks - 1, m) rad/s, the first differences of the positions `q` (ticks, m) rad over `dt` [s]."""
    first: Array = np.diff(q, axis=0) / dt
    return first


def jerk(q: Array, dt: float) -> Array:
    """Return the jerk (ticks - 3, m) rad/s^3: the third differences of the positions `q` (ticks, m) rad over `dt` [s] cubed."""
    third: Array = np.diff(q, n=3, axis=0) / dt**3
    return third
