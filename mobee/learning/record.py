# SPDX-License-Identifier: Apache-2.0
"""Rebuilds spaces and transition models from the record of a run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mobee.errors import InvalidValue, MobeeError, UnknownName
from mobee.learning.lattice import Lattice
from mobee.learning.object_space import Grid, ObjectSpace
from mobee.learning.space import Space, Voronoi
from mobee.learning.transitions import TransitionModel
from mobee.robot.load import load_robot
from mobee.robot.robot import Robot
from mobee.store import TransitionStore

_OF_A_RECORD = {"robot", "digest", "kind"}


def space_from(settings: Mapping[str, Any], robot: Robot) -> Space:
    """Rebuild a space from its recorded settings (`Space.settings`), for a robot of the recorded name.

    Raises InvalidValue if `settings` are not those of a space, or are of another robot; MobeeError if the rebuilt space differs from the
    recorded one, because the robot's limits or this program have changed.
    """
    kinds: dict[str, type[Space]] = {"lattice": Lattice, "voronoi": Voronoi, "space": Space, "object": ObjectSpace}
    if not isinstance(settings, Mapping):
        raise InvalidValue(f"{settings!r} is not the record of a space: give Space.settings.")
    kind = settings.get("kind", "lattice")
    if kind == "discrete":
        raise InvalidValue("the record is of a DiscreteSpace, without its goals: make DiscreteSpace(states, actions, goals) as before.")
    if kind not in kinds or not {"robot", "digest", "joints"} <= settings.keys():
        raise InvalidValue(f"the record with {', '.join(settings) or 'nothing'} (kind {kind!r}) is not of a space: give Space.settings.")
    if settings["robot"] != robot.name:
        raise InvalidValue(f"the space on record is of robot {settings['robot']!r}, given {robot.name!r}: load that robot.")
    try:
        space = _object_space(settings, robot) if kind == "object" else _posture_space(kinds[kind], settings, robot)
    except MobeeError:  # such as UnknownName, which is a KeyError, for a joint that the robot does not have
        raise
    except (KeyError, TypeError) as error:  # of a name, or a value of a type, that this program never writes
        raise InvalidValue(f"the record of a {kind} is damaged: {' '.join(str(error).split())}") from error
    if space.settings["digest"] != settings["digest"]:
        raise MobeeError(
            f"the space made from the record ({kind} of {space.part}) has other samples or neighbours than the one recorded "
            f"(digest {space.settings['digest']}, on record {settings['digest']}): use the robot file and version that recorded it."
        )
    return space


def _posture_space(kind: type[Space], settings: Mapping[str, Any], robot: Robot) -> Space:
    arguments = {name: value for name, value in settings.items() if name not in _OF_A_RECORD}
    if arguments.get("seed", 0) is None:  # samples that were given, not drawn
        del arguments["seed"]
    return kind(robot, **arguments)


def _object_space(settings: Mapping[str, Any], robot: Robot) -> Space:
    return ObjectSpace(space_from(settings["postures"], robot), Grid(**settings["grid"]), settings["object"])


def model_from(space: Space, settings: Mapping[str, Any]) -> TransitionModel:
    """Return a new transition model of a space, without observations.

    `settings`: as `CuriousLearner.settings` returns them; only "initial", "divergence", "forgetting" and "detector" are used. A setting
    that is absent has the default of `TransitionModel`.
    """
    return TransitionModel(space, **{key: settings[key] for key in ("initial", "divergence", "forgetting", "detector") if key in settings})


@dataclass(frozen=True, slots=True)
class Learned:
    """The space and the transition model of an agent, rebuilt from its transitions.

    `part`: name of the agent, which is the name of its part. `transitions`: number of transitions. `state`: the state in which the last
    transition ended.
    """

    part: str
    space: Space
    model: TransitionModel
    transitions: int
    state: int
    """The state in which the last transition ended."""


def load_learned(file: str | Path, part: str | None = None, robot: Robot | None = None) -> Learned:
    """Rebuild the space and the transition model of an agent from its transitions on disk.

    Args:
        file: a file of `mobee.store.TransitionStore`, as a run writes it.
        part: the agent's part; None is valid if the file contains one agent.
        robot: the robot of the space; None is valid if it is a shipped robot.

    Raises:
        MobeeError, UnknownName: no such file or agent, no transitions, or a robot that is not the recorded one.
    """
    if not Path(file).is_file():
        raise MobeeError(
            f"{file}: there is no such file; runs of `mobee launch` write such files. Experiments write cells, without a model to "
            "plan with; `mobee export` reads both."
        )
    with TransitionStore(file, part or "", read_only=True) as store:
        agents = store.agents()
        if not agents:
            raise MobeeError(f"{file} holds no transitions yet.")
        if part is None and len(agents) > 1:
            raise MobeeError(f"{file} holds several agents: name one of {', '.join(agents)}.")
        name = agents[0] if part is None else part
        if name not in agents:
            raise UnknownName("agent", name, agents)
        settings, made = store.settings(name), store.load(name)
    if "space" not in settings:
        raise MobeeError(f"{file}: {name} has no space on record: the file was not written by a curious agent.")
    space = space_from(settings["space"], robot if robot is not None else load_robot(settings["space"]["robot"]))
    model = model_from(space, settings)
    for transition in made:
        model.observe(transition.s, transition.a, transition.s_next)
    return Learned(name, space, model, len(made), made[-1].s_next)
