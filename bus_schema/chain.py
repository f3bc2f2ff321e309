"""Messages of the control chain: one each of robot_sim, model and controller in every tick.

Between `Tick` and `Commands` the model sends `Forces` (messages.py).  What parts say and are told one by one is in messages.py too.
"""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta, Struct

from bus_schema.messages import Clock, Count, GateState, Message, Mode, Name, RobotVector


class PartStatus(Struct, frozen=True, forbid_unknown_fields=True):
    """When a part was sampled, and whom it obeys; as in `State`."""

    k: Count  # tick
    t: Count  # ns, bus clock
    mode: Mode  # of the command in force
    gate: GateState
    faults: Count  # bit field, 0 = none
    epoch: Count  # drive epoch in force
    cmd_seq: int  # of the command in force, -1 = none
    cmd_age: int  # ticks since the state it answers, -1 = none


class Tick(Clock, frozen=True, kw_only=True):
    """Start of tick k, with the newest state of every part, each of its own sampling time."""

    q: RobotVector  # rad, encoders
    parts: dict[Name, PartStatus]  # of all parts


class Order(Struct, frozen=True, forbid_unknown_fields=True):
    """To whom of a part's owners `Commands` is loyal, and how its numbers are meant."""

    epoch: Count
    mode: Mode


class Answer(Struct, frozen=True, forbid_unknown_fields=True):
    """Lockstep: what `StepDone` would say, along with the commands."""

    ok: bool
    busy: list[Name]
    including: list[Name]


class Commands(Message, frozen=True, kw_only=True):
    """What the motors shall do, in answer to tick re_k; of parts that are not named nothing is said."""

    re_k: Count
    parts: dict[Name, Order]
    ref: RobotVector  # rad, rad/s or N m, by the part's mode; ignored on hold
    ttl: Annotated[int, Meta(gt=0, le=1000)]  # ms after which these parts hold
    answer: Answer | None  # None: the tick is not answered yet, or needs no answer
