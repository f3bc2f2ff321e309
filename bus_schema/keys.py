"""Key expressions, as functions; the robot's name is the session's namespace, so it is not part of them."""

from __future__ import annotations

import re

CLOCK = "clock"
TICK = "tick"
COMMANDS = "commands"
ESTOP = "estop"
ESTOP_RESET = "estop/rpc/reset"
MODEL_FORCES = "model/forces"
CONTROLLER_FORCES = "controller/forces"
MODEL_TARGETS = "model/targets"
MODEL_POSE = "model/pose"
MODEL_CONTACTS = "model/contacts"
MODEL_JACOBIAN = "model/rpc/jacobian"
SIM_TRUTH = "sim/truth"

ALL_ALIVE = "alive/*/*"
ALL_STATES = "*/state"
ALL_EVENTS = "event/*"
ALL_TRANSITIONS = "agents/*/transition"
ALL_LEARNED = "agents/*/learned"
ALL_WORLD = "world/*"
ALL_DONE = "done/*"

EYES = ("left", "right")

_CHUNK = re.compile(r"[a-z0-9_]+")


def chunk(name: str) -> str:
    """The name, if it may stand in a key; wildcards, blanks, slashes and capitals may not (ValueError)."""
    if not _CHUNK.fullmatch(name):
        raise ValueError(f"{name!r} cannot stand in a key: use a-z, 0-9 and _ only")
    return name


def state(part: str) -> str:
    """Motor state of a part at its own sampling time: robot_sim to whoever listens."""
    return f"{chunk(part)}/state"


def command(part: str) -> str:
    """Motor command of one part: whoever drives a single part, to robot_sim; the controller sends COMMANDS."""
    return f"{chunk(part)}/cmd"


def motion(part: str) -> str:
    """Where the action of a part stands: controller to all."""
    return f"{chunk(part)}/motion"


def reach(part: str) -> str:
    """How far a reach of a part has come: controller to model and who reaches."""
    return f"{chunk(part)}/reach"


def done(who: str) -> str:
    """Lockstep: a participant has answered a tick."""
    return f"done/{chunk(who)}"


def turn(who: str) -> str:
    """Lockstep: a tick waits for that participant."""
    return f"turn/{chunk(who)}"


def meta(part: str) -> str:
    """What a part is made of: robot_sim, on request."""
    return f"{chunk(part)}/meta"


def drive(part: str, verb: str) -> str:
    """Ownership of a part's motors at robot_sim: take, arm, release, hold."""
    return f"{part if part == '*' else chunk(part)}/rpc/drive/{chunk(verb)}"


def goal(part: str, verb: str) -> str:
    """Ownership of a part's attractor at the controller, and its use: take, release, goal, force, reach."""
    return f"{part if part == '*' else chunk(part)}/rpc/{chunk(verb)}"


def waypoint(part: str) -> str:
    """Where a motion may be undone to: the filter of the first MoBeE, on request."""
    return f"{part if part == '*' else chunk(part)}/rpc/waypoint"


def sim(verb: str) -> str:
    """The simulator itself: reset, pause, resume, place."""
    return f"sim/rpc/{chunk(verb)}"


def world_rpc(verb: str) -> str:
    """Edits of the model's world: add, move, remove, role, attach, detach, list."""
    return f"model/rpc/world/{chunk(verb)}"


def service_rpc(who: str, verb: str) -> str:
    """What every service answers: stat, mark, config, shutdown."""
    return f"{chunk(who)}/rpc/{chunk(verb)}"


def world(name: str) -> str:
    """An object as it was perceived: vision to model."""
    return f"world/{chunk(name)}"


def image(eye: str) -> str:
    """Picture of one eye."""
    return f"vision/image/{chunk(eye)}"


def camera(eye: str) -> str:
    """Calibration and posture that belong to the picture of the same tick."""
    return f"vision/camera/{chunk(eye)}"


def transition(agent: str) -> str:
    """One observed transition of an agent."""
    return f"agents/{chunk(agent)}/transition"


def learned(agent: str) -> str:
    """What an agent knows and expects now."""
    return f"agents/{chunk(agent)}/learned"


def event(who: str) -> str:
    """What a service has to tell a person."""
    return f"event/{chunk(who)}"


def alive(who: str, instance: str) -> str:
    """Liveliness token of one process."""
    return f"alive/{chunk(who)}/{chunk(instance)}"
