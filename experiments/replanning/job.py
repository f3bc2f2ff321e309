"""What the performer is given to do, and what it says of it: see `experiments.kit.live`."""

from __future__ import annotations

from msgspec import Struct


class Job(Struct, frozen=True):
    """Crossings to make: after how many seconds of each the ball turns solid."""

    after: list[float]


class Acted(Struct, frozen=True):
    """A motion; ticks are robot_sim's."""

    vertex: int  # to which it was sent
    asked: int  # tick at which it was asked for
    commanded: int  # tick in which a command that knows of it was first in force
    bump: int  # tick at which the model first said that the arm touches the ball, -1: never
    ended: int  # tick at which its end was known
    thinking: float  # s of processor time between the end of the motion before and the request


class Crossing(Struct, frozen=True):
    """From the right of the ball to its left."""

    solid: int  # tick at which the ball was made solid
    motions: list[Acted]
