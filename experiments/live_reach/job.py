"""What the performer is given to do, and what it says of it: see `experiments.kit.live`."""

from __future__ import annotations

from typing import Literal

from msgspec import Struct

from experiments.live_reach.problems import Problem

Kind = Literal["refine", "learner", "peer", "moving", "first motion"]


class Job(Struct, frozen=True):
    """A block of tries on one launch of the system."""

    kind: Kind
    seed: int
    store: str
    """File of what was learned."""
    problems: list[Problem] = []
    tries: int = 0
    """To be there in all when the learner has refined."""


class Tried(Struct, frozen=True):
    """A try; ticks are robot_sim's."""

    kind: str
    number: int
    out: int  # tick at which the arm set out for where it begins
    begin: int  # at which the target was presented
    ends: list[int]  # ticks at which the hand was to be there
    over: int  # tick at which the arm rested again
    off: float  # rad, from the posture to begin in
    actions: int
    believed: float  # m, that were missing by the encoders, in the end
    thinking: float  # s of processor time spent on plans
    why: str = ""  # it ended without a reach
    asked: int = 0  # tick of the last request
    there: list[float] | None = None  # m, where a target that moves was at the last of the ends
    first: int = -1  # ticks from the last request to the first command that moves, where that was looked at
