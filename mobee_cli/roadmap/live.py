# SPDX-License-Identifier: Apache-2.0
"""Moves the running robot along a path of a roadmap."""

from __future__ import annotations

import argparse
import json
import logging
import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from bus_schema import keys
from bus_schema.rpc import Config, Empty
from bus_schema.rpc import World as WorldReply
from mobee import Gains, Model, World
from mobee.errors import ActionInterrupted, MobeeError
from mobee.model.kinematics import matrix_from_quaternion
from mobee.model.world_object import Geometry
from mobee.roadmap.archive import robot_digest, world_digest
from mobee.roadmap.playback import PERIOD, Played, attractors, carrying, moving, timed, watched
from mobee.roadmap.roadmap import Roadmap
from mobee.robot.load import load_robot
from mobee.robot.robot import Robot
from mobee_cli.connect import connected
from mobee_cli.errors import UserError
from mobee_cli.roadmap.progress import Progress
from mobee_cli.roadmap.query import find_path, require_free
from services.common import rpc
from services.common.bus_follow import BusFollower
from services.common.config import ServiceConfig
from services.common.exit_codes import BAD_INPUT, ENVIRONMENT, FAILED, INTERRUPTED
from services.common.service import Service

WHO = f"mobee_roadmap_{os.getpid()}"
TRIES = 3


@dataclass(frozen=True, slots=True, eq=False)
class Running:
    """The running system, to which this program is connected.

    `robot`: the robot of the system. `world`: copy of the world in the system's model service. `gains`: gains of the system's controller.
    `service`: this program's connection to the bus.
    """

    robot: Robot
    world: World
    gains: Gains
    service: Service


def play_live(trm: Roadmap, arguments: argparse.Namespace) -> tuple[Roadmap, dict[str, Any], Played, Gains]:
    """Move the robot of the running system from its present pose along a path of the roadmap to the goal in `arguments`.

    Returns the roadmap in the world of the running system, the planned path (as `mobee_cli.roadmap.query.find_path` returns it), the motion
    along it, and the gains of the running control law.
    """
    if arguments.start is not None:
        raise UserError("--from is only valid offline: with --live the path begins where the robot is", BAD_INPUT)
    with running_system(arguments.endpoint) as running:
        trm = in_running_world(trm, running, arguments.other_world)
        plant = BusFollower(running.service, running.robot)
        progress = Progress(running.service, trm)
        running.service.ready()
        # The path begins where the robot is: a torso that turns back after a reach is elsewhere a second later.
        plant.come_to_rest(carrying(running.robot, trm.motors), running.gains.settle)
        found = find_path(trm, np.clip(plant.q, *running.robot.limits.T), arguments.to)
        require_free(trm, found, arguments.anyway)
        try:
            played = _played(plant, running, found, arguments.speed, progress)
        except ActionInterrupted as interruption:
            raise UserError(f"the motion was interrupted: {interruption}. `mobee status` shows the state of the robot.", FAILED) from None
        except KeyboardInterrupt:
            raise UserError("interrupted: the robot stays where it is", INTERRUPTED) from None
        except MobeeError as error:
            raise UserError(str(error), FAILED) from None
        finally:
            progress.end()
            plant.let_go()
    return trm, found, played, running.gains


def _played(plant: BusFollower, running: Running, found: dict[str, Any], speed: float, progress: Progress) -> Played:
    path = np.array(found["poses"])
    parts = moving(running.robot, path)
    if not parts:
        raise UserError("the robot is at the goal already", BAD_INPUT)
    wanted = timed(running.robot, path, running.gains, speed)
    plant.take(parts)
    progress.begin(np.array(found["place"]), wanted)
    outcomes = plant.follow(
        parts, list(attractors(running.robot, wanted, running.gains)), PERIOD, lambda share: progress.note(share, plant.q)
    )
    progress.rest(plant.q)
    return watched(Model(running.robot, running.world), wanted, *plant.seen(), all(one.settled for one in outcomes.values()))


def in_running_world(trm: Roadmap, running: Running, other_world: bool) -> Roadmap:
    """Return the roadmap with the world of the running system in place of its own.

    Raises UserError if the robots differ, or if the obstacles differ and `other_world` is False. Only obstacles are compared: targets may
    have moved since the roadmap was built. A path through the returned roadmap is checked for contacts with the objects where they are now.
    """
    made, now = robot_digest(trm.model.robot), robot_digest(running.robot)
    if made != now:
        raise UserError(f"the map is of robot {made}, and the running robot {running.robot.name} is {now}: build a map for it", BAD_INPUT)
    made, now = (world_digest(world, roles=("obstacle",)) for world in (trm.model.world, running.world))
    if made != now and not other_world:
        raise UserError(
            f"the obstacles of the map's world ({_obstacles(trm.model.world)}) and of the running model's world "
            f"({_obstacles(running.world)}) differ: build a map in that world, or use --other-world: then only the path is checked there",
            BAD_INPUT,
        )
    return replace(trm, model=Model(running.robot, running.world))


def _obstacles(world: World) -> str:
    return ", ".join(name for name, one in world.objects.items() if one.role == "obstacle") or "none"


@contextmanager
def running_system(endpoint: str) -> Iterator[Running]:
    """Connect to the system at `endpoint` for the block of a `with` statement.

    Raises UserError if its controller or model does not answer.
    """
    with connected(endpoint) as session:
        try:
            settings = json.loads(rpc.call(session, WHO, keys.service_rpc("controller", "config"), Empty, Config, tries=TRIES).config)
            objects = rpc.call(session, WHO, keys.world_rpc("list"), Empty, WorldReply, tries=TRIES).objects
        except rpc.CallFailed as failed:
            raise UserError(
                f"controller or model do not answer at {endpoint} ({failed}): `mobee status` shows what runs", ENVIRONMENT
            ) from None
        robot, world = load_robot(settings["robot"]), World()
        for one in objects:
            shape, turn = Geometry(one.geometry.kind, tuple(one.geometry.size)), matrix_from_quaternion(np.array(one.quaternion))
            world.add(one.name, shape, position=one.position, rotation=turn, role=one.role)
        with Service(WHO, ServiceConfig(endpoint=endpoint, robot=settings["robot"]), robot, session=session) as service:
            signal.signal(signal.SIGINT, signal.default_int_handler)  # Ctrl-C ends the motion, and the verb reports it
            logging.getLogger().setLevel(logging.CRITICAL)  # the verb itself prints what the user needs
            yield Running(robot, world, Gains.named(settings["gains"]), service)
