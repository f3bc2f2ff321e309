"""What became of a block, by the simulator's truth: what is kept when its record of every tick is thrown away."""

from __future__ import annotations

from pathlib import Path

import msgspec
import numpy as np
from msgspec import Struct

from experiments.kit.live import read_done
from experiments.kit.recordings import CONTACTS, POSITIONS, Touch, read_touches
from experiments.live_reach.job import Job, Tried
from experiments.live_reach.settings import DEEP, GOOD, MARKER, PART, robot
from mobee import Model
from mobee.reach import RADIUS
from mobee.robot.robot import Array

BLOCK = "block.json"
STILL = 20  # ticks before a request, in which it is seen how much joints move at rest
MOVED = 1e-5  # rad, more than that


class Judged(Struct, frozen=True):
    """A try by what was true."""

    kind: str
    number: int
    position: list[float]  # m
    off: float  # m, from the target's surface, when the hand was to be there for the last time
    success: bool
    seconds: float  # robot time from the presentation to that moment
    actions: int
    reaches: int
    thinking: float  # s of processor time spent on plans
    deep: list[Touch]  # solid contacts deeper than 2 mm from when the arm set out from home to its rest
    begun_off: float  # rad, from the posture to begin in
    why: str  # it came to no end
    first: int  # ticks from request to the first command that moves, -1: not looked at
    first_motion: int  # ticks from request to where a joint first truly moves, -1: not looked at


class Block(Struct, frozen=True):
    """All tries of a job."""

    kind: str
    rate: float  # Hz
    seconds: float  # of robot time
    repeatable: bool
    tries: list[Judged]
    deep: list[Touch]  # solid contacts deeper than 2 mm, of the whole block


def measure(folder: Path, job: Job, rate: float, repeatable: bool) -> Block:
    """What a launch has left in its folder."""
    q = np.fromfile(folder / POSITIONS).reshape(-1, len(robot().motors))
    deep = [touch for touch in read_touches(folder / CONTACTS, 1.0 / rate) if touch.depth > DEEP]
    done = read_done(folder, Tried)
    problems = {(problem.kind, problem.number): problem for problem in job.problems}
    model = Model(robot())
    judged = [judge(tried, np.array(tried.there or problems[tried.kind, tried.number].position), q, deep, model, rate) for tried in done]
    return Block(job.kind, rate, len(q) / rate, repeatable, judged, deep)


def judge(tried: Tried, position: Array, q: Array, deep: list[Touch], model: Model, rate: float) -> Judged:
    """A try; `q` (T, n) rad: row k - 2 is where the robot was at the beginning of tick k."""
    off = np.inf
    if tried.ends:
        palm = model.evaluate(q[tried.ends[-1] - 2]).position(MARKER)
        off = max(0.0, float(np.linalg.norm(palm - position)) - RADIUS)
    return Judged(
        kind=tried.kind,
        number=tried.number,
        position=position.tolist(),
        off=off,
        success=off <= GOOD,
        seconds=(tried.ends[-1] - tried.begin) / rate if tried.ends else 0.0,
        actions=tried.actions,
        reaches=len(tried.ends),
        thinking=tried.thinking,
        deep=[touch for touch in deep if tried.out <= touch.begin <= tried.over],
        begun_off=tried.off,
        why=tried.why,
        first=tried.first,
        first_motion=_first_motion(q, tried.asked) if tried.first >= 0 else -1,
    )


def _first_motion(q: Array, asked: int) -> int:
    """Ticks from a request to the first in which a joint of the arm has gone further than it does at rest."""
    arm = q[:, robot().parts[PART].slice]
    before, after = arm[asked - STILL : asked], arm[asked:]
    bound = MOVED + np.ptp(before, axis=0).max()
    moved = np.abs(after - before[-1]).max(axis=1) > bound
    return int(np.argmax(moved)) + 1 if moved.any() else -1


def write_block(folder: Path, block: Block) -> None:
    """Write it whole or not at all."""
    new = (folder / BLOCK).with_suffix(".new")
    new.write_bytes(msgspec.json.format(msgspec.json.encode(block), indent=1))
    new.replace(folder / BLOCK)


def read_block(folder: Path) -> Block:
    """What `write_block` wrote."""
    return msgspec.json.decode((folder / BLOCK).read_bytes(), type=Block)
