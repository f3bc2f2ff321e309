# SPDX-License-Identifier: Apache-2.0
"""Keys of calls and of liveliness tokens, as functions; the keys of streams stand beside their messages.

The robot's name is the namespace of the session, so it is not part of them.
"""

from __future__ import annotations

from bus_schema.stream import chunk

ESTOP_RESET = "estop/rpc/reset"
MODEL_JACOBIAN = "model/rpc/jacobian"
ALL_ALIVE = "alive/*/*"
EYES = ("left", "right")


def meta(part: str) -> str:
    """Motors and limits of a part: robot_sim."""
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
    """Mark a pose to which a motion may be undone: port_filter."""
    return f"{_part_or_all(part)}/rpc/waypoint"


def sim(verb: str) -> str:
    """The simulator: robot_sim; reset, pause, resume, place."""
    return f"sim/rpc/{chunk(verb)}"


def world_rpc(verb: str) -> str:
    """Edits of the model's world: model; add, move, remove, role, attach, detach, list."""
    return f"model/rpc/world/{chunk(verb)}"


def service_rpc(who: str, verb: str) -> str:
    """Calls that every service answers: stat, mark, config, shutdown."""
    return f"{chunk(who)}/rpc/{chunk(verb)}"


def alive(who: str, instance: str) -> str:
    """Liveliness token of one process."""
    return f"alive/{chunk(who)}/{chunk(instance)}"


def _part_or_all(part: str) -> str:
    return part if part == "*" else chunk(part)
