"""What became of the crossings of a launch, on robot_sim's clock and by the simulator's joints."""

from __future__ import annotations

from pathlib import Path

import msgspec
import numpy as np
from msgspec import Struct

from experiments.babbling.contacts import read_touches
from experiments.babbling.measured import CONTACTS, POSITIONS
from experiments.kit.live import read_done
from experiments.replanning.job import Crossing
from experiments.replanning.scene import BALL, LEFT, PART, RATE, new_map, robot
from mobee.robot.robot import Array

MEASURED, POSES = "measured.json", "poses.npz"
EVERY = 5  # ticks, of the poses that are kept for pictures


class Measured(Struct, frozen=True):
    """A crossing."""

    bumped: bool  # the ball was felt on the short way
    command: float  # ms from the bump to the first command in force that knows of the new way
    turn: float  # ms from the bump until the joints come no nearer to where the old way led
    on: list[int]  # vertices to which it was sent
    arrived: bool
    seconds: float  # from the start to the other side
    deepest: float  # m, of a solid contact with the ball, by the simulator
    thinking: float  # ms of processor time, from the end of the failed motion to the request


def measure(folder: Path) -> list[Measured]:
    """What a launch has left in its folder; keeps of the record of every tick what pictures need."""
    q = np.fromfile(folder / POSITIONS).reshape(-1, len(robot().motors))
    touches = [touch for touch in read_touches(folder / CONTACTS, 1.0 / RATE) if BALL in touch.pair]
    found = []
    for crossing in read_done(folder, Crossing):
        first, last = crossing.motions[0].asked, crossing.motions[-1].ended
        deep = [touch.depth for touch in touches if first <= touch.begin <= last]
        found.append(_measured(crossing, q, max(deep, default=0.0)))
    (folder / MEASURED).write_bytes(msgspec.json.format(msgspec.json.encode(found), indent=1))
    return found


def read_measured(folder: Path) -> list[Measured]:
    """What `measure` wrote."""
    return msgspec.json.decode((folder / MEASURED).read_bytes(), type=list[Measured])


def keep_poses(folder: Path) -> None:
    """Of the first crossing, keep poses and times for pictures: `q` (T, n) rad, `times` (T,) s, and those of `solid` and `bump`."""
    q, crossing = np.fromfile(folder / POSITIONS).reshape(-1, len(robot().motors)), read_done(folder, Crossing)[0]
    ticks = np.arange(crossing.motions[0].asked, crossing.motions[-1].ended, EVERY)
    begin, told = ticks[0], {"solid": crossing.solid, "bump": _bump(crossing)}
    np.savez_compressed(folder / POSES, q=q[ticks - 2], times=(ticks - begin) / RATE, **{k: (v - begin) / RATE for k, v in told.items()})


def _bump(crossing: Crossing) -> int:
    return next((motion.bump for motion in crossing.motions if motion.bump >= 0), -1)


def _measured(crossing: Crossing, q: Array, deepest: float) -> Measured:
    motions = crossing.motions
    failed = next((number for number, motion in enumerate(motions[:-1]) if motion.bump >= 0), None)
    told = {"on": [motion.vertex for motion in motions], "arrived": motions[-1].vertex == LEFT and motions[-1].bump < 0}
    seconds = (motions[-1].ended - motions[0].asked) / RATE
    if failed is None:
        return Measured(False, -1.0, -1.0, **told, seconds=seconds, deepest=deepest, thinking=0.0)
    bump, new = motions[failed].bump, motions[failed + 1]
    turn = _turned(q, bump, motions[failed].vertex, new.ended)
    command = 1e3 * (new.commanded - bump) / RATE
    return Measured(True, command, 1e3 * turn / RATE, **told, seconds=seconds, deepest=deepest, thinking=1e3 * new.thinking)


def _turned(q: Array, bump: int, vertex: int, ended: int) -> int:
    """Ticks from a bump until the arm is nearest to a vertex; row k - 2 of q (T, n) rad is of the beginning of tick k."""
    space = new_map().space
    arm = q[:, robot().parts[PART].slice][:, space.columns]
    return int(np.linalg.norm(arm[bump - 2 : ended - 2] - space.samples[vertex], axis=1).argmin())
