# SPDX-License-Identifier: Apache-2.0
"""Keys of calls and of liveliness tokens, as functions; the keys of streams are in the messages (`Message.stream`).

The robot's name is the namespace of the session, so it is not part of them.
"""

from __future__ import annotations

from bus_schema.stream import chunk

ESTOP_RESET = "estop/rpc/reset"
MODEL_JACOBIAN = "model/rpc/jacobian"
ALL_ALIVE = "alive/*/*"


def meta(part: str) -> str:
    """Return the key of the call to robot_sim for the motors and limits of a part."""
    return f"{chunk(part)}/meta"


def drive(part: str, verb: str) -> str:
    """Return the key of a call to robot_sim that owns a part's motors.

    `verb`: take, arm, release or hold.  The part * means all parts.
    """
    return f"{_part_or_all(part)}/rpc/drive/{chunk(verb)}"


def goal(part: str, verb: str) -> str:
    """Return the key of a call to the controller that owns or uses a part's attractor.

    `verb`: take, release, goal, force or reach.  The part * means all parts.
    """
    return f"{_part_or_all(part)}/rpc/{chunk(verb)}"


def waypoint(part: str) -> str:
    """Return the key of the call to port_filter that marks the present pose as one to which it may move back."""
    return f"{_part_or_all(part)}/rpc/waypoint"


def sim(verb: str) -> str:
    """Return the key of a call to robot_sim about the simulation; `verb`: reset, pause, resume, place or pace."""
    return f"sim/rpc/{chunk(verb)}"


def world_rpc(verb: str) -> str:
    """Return the key of a call to the model about its world; `verb`: add, move, remove, role, attach, detach or list."""
    return f"model/rpc/world/{chunk(verb)}"


def service_rpc(who: str, verb: str) -> str:
    """Return the key of a call that every service answers; `verb`: stat, mark, config or shutdown; of an agent rest, resume or explore."""
    return f"{chunk(who)}/rpc/{chunk(verb)}"


def alive(who: str, instance: str) -> str:
    """Return the key of the liveliness token of one process."""
    return f"alive/{chunk(who)}/{chunk(instance)}"


def _part_or_all(part: str) -> str:
    return part if part == "*" else chunk(part)
