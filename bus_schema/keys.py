# SPDX-License-Identifier: Apache-2.0
"""Keys (names on the message bus) of calls, and of liveliness tokens, which exist as long as a process runs, as functions.

The keys of streams are in the messages (`Message.stream`). Keys do not contain the robot's name, because Zenoh, the library of the bus,
prefixes all keys of a session with it (the namespace).
"""

from __future__ import annotations

from bus_schema.stream import chunk

ESTOP_RESET = "estop/rpc/reset"
MODEL_JACOBIAN = "model/rpc/jacobian"
ALL_ALIVE = "alive/*/*"


def meta(part: str) -> str:
    """Return the key of the call by which robot_sim returns the motors of a part and their limits."""
    return f"{chunk(part)}/meta"


def drive(part: str, verb: str) -> str:
    """Return the key of a call to robot_sim about the drive of a part, that is, the right to command its motors.

    `part`: name of the part; * means all parts. `verb`: take, arm, release or hold.
    """
    return f"{_part_or_all(part)}/rpc/drive/{chunk(verb)}"


def goal(part: str, verb: str) -> str:
    """Return the key of a call to the controller about the goal of a part, that is, the right to set its attractor.

    `part`: name of the part; * means all parts. `verb`: take, release, goal (set the attractor), force (apply a client's force) or reach
    (pull a marker to an object).
    """
    return f"{_part_or_all(part)}/rpc/{chunk(verb)}"


def waypoint(part: str) -> str:
    """Return the key of the call that marks the newest safe pose as a waypoint, to which the port filter may later move the robot back.

    The port filter is a service that forwards commands of clients, and moves the robot back from unsafe poses. If it has found no motion
    back, the call instead declares the present pose safe. `part`: name of any part, since the call concerns the whole robot; * means all
    parts.
    """
    return f"{_part_or_all(part)}/rpc/waypoint"


def sim(verb: str) -> str:
    """Return the key of a call to robot_sim about the simulation.

    `verb`: reset, pause, resume, place (move an object) or pace (set the speed in lockstep).
    """
    return f"sim/rpc/{chunk(verb)}"


def world_rpc(verb: str) -> str:
    """Return the key of a call to the model about its world; `verb`: add, move, remove, role, attach, detach or list."""
    return f"model/rpc/world/{chunk(verb)}"


def service_rpc(who: str, verb: str) -> str:
    """Return the key of a call to the service `who`.

    `verb`: every service answers stat (status), pulse (numbers that show whether it handles messages), mark (set the counters to 0), config
    and shutdown; an agent also answers rest (release its part), resume and explore (set its exploration strategy).
    """
    return f"{chunk(who)}/rpc/{chunk(verb)}"


def alive(who: str, instance: str) -> str:
    """Return the key of the liveliness token of one process; `who`: name of its service; `instance`: id of the process."""
    return f"alive/{chunk(who)}/{chunk(instance)}"


def _part_or_all(part: str) -> str:
    return part if part == "*" else chunk(part)
